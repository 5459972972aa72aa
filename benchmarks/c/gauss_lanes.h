/* Gauss collocation of order 2 STAGES, solved by fixed-point sweeps over all stages at once, one stage in each SIMD
   lane. With 8 stages this is IRKGL16 (Antonana, Makazaga, Murua, arXiv 2511.03655).

   The unknowns are L_j = h b_j f(Z_j), where the stages are Z_i = x + sum_j mu_ij L_j with mu_ij = a_ij / b_j. The
   rounded mu_ij satisfy mu_ij + mu_ji = 1 exactly; otherwise quadratic invariants would drift in proportion to the
   time. */
#ifndef MEASURED
#define MEASURED DIM /* number of coordinates that count in the size of the state; a time as last coordinate does not */
#endif
enum { PACKS = (STAGES + WIDTH - 1) / WIDTH, SLOTS = PACKS * WIDTH, HISTORY = 2, MOST_SWEEPS = 100 };

/* Weights by which the L_j are predicted from the L_j of the last HISTORY steps; `set_predictor` sets them. */
static double predictor[HISTORY][STAGES][STAGES];

void set_predictor(const double *weights)
{
    memcpy(predictor, weights, sizeof predictor);
}

static struct {
    double h;                                     /* step size of the tables below; 0 before they are computed */
    real weight[PACKS];                           /* h b_j */
    real mu[STAGES][PACKS];                       /* column j: factors of L_j in all stages Z_i */
    real guess[HISTORY][STAGES][PACKS];           /* mu times the predictor: factors of past L_j in predicted Z_i */
    double flow[HISTORY][DIM][SLOTS] __attribute__((aligned(64))); /* L_j of the last steps, a ring buffer */
    int newest, steps;                            /* index of the last step in the buffer; number of steps in it */
    int expected;                                 /* number of the first sweep whose change is computed */
    double rate;                                  /* estimated factor by which a sweep reduces the error */
    double carry[DIM];                            /* compensation term of x */
    long evaluations;
    int failed;
} gauss;

INLINE void set_column(real *column, const double values[SLOTS])
{
    memcpy(column, values, PACKS * sizeof *column);
}

static void set_tables(double h)
{
    double column[SLOTS] = { 0.0 };
    gauss.h = h;
    for (int j = 0; j < STAGES; ++j) column[j] = h * lanes_b[j];
    set_column(gauss.weight, column);
    for (int j = 0; j < STAGES; ++j) {
        for (int i = 0; i < STAGES; ++i)
            column[i] = i < j ? 1.0 - lanes_mu[j * STAGES + i] : i == j ? 0.5 : lanes_mu[i * STAGES + j];
        set_column(gauss.mu[j], column);
        for (int m = 0; m < HISTORY; ++m) {
            for (int i = 0; i < STAGES; ++i) {
                column[i] = 0.0;
                for (int l = 0; l < STAGES; ++l)
                    column[i] += lanes_mu[i * STAGES + l] * lanes_b[l] * predictor[m][l][j] / lanes_b[j];
            }
            set_column(gauss.guess[m][j], column);
        }
    }
    gauss.rate = 0.5;
    gauss.expected = 2;
}

/* Z[p][i] += sum_j columns[j][p] L_j[i] */
INLINE void combine(const real columns[STAGES][PACKS], const double flow[DIM][SLOTS], real Z[PACKS][DIM])
{
#pragma GCC unroll 32
    for (int i = 0; i < DIM; ++i)
#pragma GCC unroll 2
        for (int p = 0; p < PACKS; ++p) {
            real even = Z[p][i] + columns[0][p] * flow[i][0], odd = columns[1][p] * flow[i][1];
#pragma GCC unroll 8
            for (int j = 2; j < STAGES; j += 2) {
                even += columns[j][p] * flow[i][j];
                odd += columns[j + 1][p] * flow[i][j + 1];
            }
            Z[p][i] = even + odd;
        }
}

INLINE void broadcast(const double x[DIM], real Z[PACKS][DIM])
{
#pragma GCC unroll 2
    for (int p = 0; p < PACKS; ++p)
#pragma GCC unroll 32
        for (int i = 0; i < DIM; ++i) Z[p][i] = (real){ 0.0 } + x[i];
}

/* L_j = h b_j f(Z_j) for all stages, into `fresh` */
INLINE void evaluate(real Z[PACKS][DIM], real fresh[PACKS][DIM])
{
#pragma GCC unroll 2
    for (int p = 0; p < PACKS; ++p) {
        field(Z[p], fresh[p]);
#pragma GCC unroll 32
        for (int i = 0; i < DIM; ++i) fresh[p][i] *= gauss.weight[p];
    }
}

INLINE void store(real fresh[PACKS][DIM], double flow[DIM][SLOTS])
{
#pragma GCC unroll 2
    for (int p = 0; p < PACKS; ++p)
#pragma GCC unroll 32
        for (int i = 0; i < DIM; ++i) memcpy(&flow[i][p * WIDTH], &fresh[p][i], sizeof(real));
}

/* The largest norm of the change of L_j by the last sweep, of all lanes. If there are two vectors of stages, a lane has
   two stages, which count together. */
INLINE double change_of(real fresh[PACKS][DIM], const double flow[DIM][SLOTS])
{
    real squares = { 0.0 };
#pragma GCC unroll 2
    for (int p = 0; p < PACKS; ++p)
#pragma GCC unroll 32
        for (int i = 0; i < DIM; ++i) {
            real before;
            memcpy(&before, &flow[i][p * WIDTH], sizeof before);
            squares += (fresh[p][i] - before) * (fresh[p][i] - before);
        }
    double most = squares[0];
    for (int l = 1; l < WIDTH; ++l) most = squares[l] > most ? squares[l] : most;
    return sqrt(most);
}

/* Make sweeps until the error is below the last bit of `size`; return their number, or 0 if they do not converge. To
   save time, the change is computed only from the sweep `expected` on, which follows from the number of sweeps of the
   step before; if a step converges at its first test, the next step tests one sweep earlier. */
INLINE int solve(const double x[DIM], double flow[DIM][SLOTS], double size)
{
    real Z[PACKS][DIM], fresh[PACKS][DIM];
    double before = 0.0;
    for (int sweep = 2; sweep <= MOST_SWEEPS; ++sweep) {
        broadcast(x, Z);
        combine(gauss.mu, flow, Z);
        evaluate(Z, fresh);
        if (sweep >= gauss.expected) {
            const double change = change_of(fresh, flow), ratio = before > 0.0 ? change / before : 1.0;
            if (ratio < 1.0 && change > 1e-14 * size) gauss.rate = 0.7 * gauss.rate + 0.3 * ratio;
            const int rounding = ratio > 0.4 && before > 0.0 && change <= 2e-14 * size;
            if (change * gauss.rate <= TOLERANCE * size || rounding) {
                store(fresh, flow);
                gauss.expected = sweep > 2 && change <= TOLERANCE * size ? sweep - 1 : sweep;
                return sweep;
            }
            if (!(change < 1e9 * size)) return 0;
            before = change;
        }
        store(fresh, flow);
        /* The next sweep reads the stored numbers one by one: keep the compiler from extracting them from registers. */
        __asm__ volatile("" : : "r"(flow) : "memory");
    }
    return 0;
}

INLINE void gauss_lanes_step(double x[DIM], double size)
{
    const int next = (gauss.newest + 1) % HISTORY;
    double(*flow)[SLOTS] = gauss.flow[next];
    real Z[PACKS][DIM], fresh[PACKS][DIM];
    broadcast(x, Z);
    if (gauss.steps == HISTORY) {
        for (int m = 0; m < HISTORY; ++m)
            combine(gauss.guess[m], gauss.flow[(gauss.newest + HISTORY - m) % HISTORY], Z);
    } else
        gauss.expected = 2;
    evaluate(Z, fresh);
    store(fresh, flow);
    __asm__ volatile("" : : "r"(flow) : "memory");
    const int sweeps = solve(x, flow, size);
    gauss.failed = sweeps == 0;
    gauss.evaluations += (long)sweeps * STAGES;
    for (int i = 0; i < DIM; ++i) {
        double even = gauss.carry[i] + flow[i][0], odd = flow[i][1];
#pragma GCC unroll 8
        for (int j = 2; j < STAGES; j += 2) {
            even += flow[i][j];
            odd += flow[i][j + 1];
        }
        const double addend = even + odd, old = x[i];
        x[i] = old + addend;
        gauss.carry[i] = addend - (x[i] - old);
    }
    gauss.newest = next;
    if (gauss.steps < HISTORY) ++gauss.steps;
}

static void gauss_lanes(double x[DIM], double h, long steps)
{
    double squares = 0.0;
    if (gauss.h != h) set_tables(h);
    for (int i = 0; i < MEASURED; ++i) squares += x[i] * x[i];
    const double size = sqrt(squares);
    for (long n = 0; n < steps && !gauss.failed; ++n) gauss_lanes_step(x, size);
}
