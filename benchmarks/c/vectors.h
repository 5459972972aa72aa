/* SIMD vectors for STAGES stages: one vector, or two vectors of four doubles if the processor has no registers of
   eight. */
#if STAGES <= 2
enum { WIDTH = 2 };
#elif STAGES <= 4 || !defined(__AVX512F__)
enum { WIDTH = 4 };
#else
enum { WIDTH = 8 };
#endif
typedef double lanes __attribute__((vector_size(8 * WIDTH)));
typedef long long lanes_of_bits __attribute__((vector_size(8 * WIDTH)));
#define REAL lanes
#define STATE double
