#ifndef PHI_FILE_LATTICE_SHARE
#define PHI_FILE_LATTICE_SHARE
#ifdef _OPENMP
#ifdef __cplusplus
extern "C" {
#endif
int omp_get_num_threads(void); /* declared here as in omp.h, a header that may be missing */
int omp_get_thread_num(void);
#ifdef __cplusplus
}
#endif
#if PHI_PAIRS
#define PHI_PARALLEL _Pragma("omp parallel if (s->sites > 512)")
#else
#define PHI_PARALLEL _Pragma("omp parallel if (s->sites > 4096)")
#endif
#define PHI_THREADS (size_t)omp_get_num_threads()
#define PHI_THREAD (size_t)omp_get_thread_num()
#else
#define PHI_PARALLEL
#define PHI_THREADS (size_t)1
#define PHI_THREAD (size_t)0
#endif

/* Divide a number of work items among the threads. The share of the calling thread begins at *first; its end is returned. */
static size_t phi_share(size_t units, size_t *first)
{
    const size_t threads = PHI_THREADS, thread = PHI_THREAD, each = units / threads, more = units % threads;
    *first = each * thread + (thread < more ? thread : more);
    return *first + each + (thread < more);
}

/* Wait for all threads. */
static void phi_wait(void)
{
#ifdef _OPENMP
    if (PHI_THREADS > 1) { /* even for one thread a barrier may cost a system call */
#pragma omp barrier
    }
#endif
}
#endif
