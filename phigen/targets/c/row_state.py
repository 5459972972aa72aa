"""Members of two structs of the C runtime: the struct of a lattice, and the struct of a row segment. Each block of
members has the statements that initialise them.
"""

from __future__ import annotations

from phigen.targets.state import StateBlock

#: The members of the struct of a lattice, in blocks. The struct declares its members in this order. The statements in
#: ``reset`` place arrays in the memory of the solver.
LATTICE = (
    StateBlock(
        "sizes",
        members=(
            "size_t sizes[PHI_AXES];   /* number of sites along each axis */",
            "size_t sites, rows;       /* number of sites, and of rows */",
            "ptrdiff_t length, width;  /* number of sites of a row; number of doubles from a row to the next */",
        ),
    ),
    StateBlock(
        "seams",
        "SEAMS",
        (
            "ptrdiff_t seams[PHI_AXES];"
            " /* along each axis, the first site of the boundary seam, where colours break their period; without"
            " a seam, the number of sites */",
            "ptrdiff_t inside[2];      /* in a row, the first site away from the seam, and the one after the last */",
        ),
    ),
    StateBlock(
        "x",
        members=("double *x[PHI_ARRAYS]; /* the values of fields, then of parameters at sites */",),
        reset=("for (size_t k = 0; k < PHI_ARRAYS; ++k, memory += block) s->x[k] = memory;",),
    ),
    StateBlock(
        "before",
        members=("double *before[PHI_DIM]; /* copies of the fields, to restore them if a step fails */",),
        reset=("for (size_t k = 0; k < PHI_DIM; ++k, memory += block) s->before[k] = memory;",),
    ),
    StateBlock(
        "lines",
        "!ONE_ROW",
        ("ptrdiff_t *lines;         /* for each row: its offset, and the offsets of the rows beside it */",),
    ),
    StateBlock(
        "gathered",
        "GATHER",
        ("double *gathered[PHI_GATHERED]; /* for each site, sums over its bonds or over all pairs */",),
        reset=("for (size_t k = 0; k < PHI_GATHERED; ++k, memory += block) s->gathered[k] = memory;",),
    ),
    StateBlock(
        "placed",
        "JACOBI",
        ("double *placed[PHI_ARRAYS]; /* as x, but with positions relative to the first body */",),
        reset=(
            "memcpy(s->placed, s->x, sizeof s->x);",
            "for (int k = 0; k < PHI_BODY_AXES; ++k, memory += block) s->placed[phi_body_axes[k][0]] = memory;",
        ),
    ),
    StateBlock(
        "placed_varied",
        "JACOBI && TANGENT",
        ("double *placed_varied[PHI_DIM]; /* variations of the positions in `placed` */",),
        reset=(
            "for (int k = 0; k < PHI_BODY_AXES; ++k, memory += block) s->placed_varied[phi_body_axes[k][0]] = memory;",
        ),
    ),
    StateBlock(
        "massive",
        "BODIES",
        (
            "ptrdiff_t massive;         /* number of bodies up to the last one with a mass */",
            "double mass;               /* sum of the masses of all bodies */",
        ),
    ),
    StateBlock(
        "bonds",
        "GRAPH",
        (
            "int *bonds;  /* for each site, the index in `other` of the first bond that starts there */",
            "int *middle; /* for each site, the index in `other` of the first bond that ends there */",
            "int *other, *number; /* for each bond of a site: the site at the opposite end, the number of the bond */",
        ),
    ),
    StateBlock(
        "at_bonds",
        "GRAPH && BOND_PARAMETERS",
        ("double *at_bonds[PHI_BOND_ARRAYS]; /* for each entry of `other`, the parameters at the bond */",),
    ),
    StateBlock(
        "colours",
        "GRAPH && BY_COLOUR",
        (
            "int *colours;             /* colour of each site; no bond connects two sites of the same colour */",
            "int colour_count, flows;  /* number of colours, and of flows in a stage */",
        ),
    ),
    StateBlock(
        "carry",
        "!SERIES && COMPENSATED",
        ("double *carry[2 * PHI_DIM]; /* compensation terms of the fields, then those of `before` */",),
        reset=("for (size_t k = 0; k < 2 * PHI_DIM; ++k, memory += block) s->carry[k] = memory;",),
    ),
    StateBlock(
        "clock",
        "MONITOR",
        (
            "double level;             /* energy level e = -H(x0). With H = A + B, log(A + e) - log(-B) stays 0 */",
            "double *densities;        /* densities of a part of H at the sites */",
            "double *clock;            /* physical times of `x` and of `before`, each with its compensation term */",
        ),
        reset=("s->densities = memory, memory += block;", "s->clock = memory, memory += block;"),
    ),
    StateBlock(
        "open",
        "!SERIES",
        (
            "int open; /* 1 if x includes the last flow of the last step, but the state in `before` does not */",
            "size_t full_range; /* the next `full_range` steps use slower functions, for arguments of any size */",
        ),
    ),
    StateBlock(
        "swept",
        "!SERIES && BY_HAND && ONE_ROW",
        ("ptrdiff_t from, to;       /* first site of the present sweep, and the one after its last */",),
        reset=("s->to = s->length;",),
    ),
    StateBlock(
        "middle",
        "SERIES",
        reset=(
            "for (int k = 0; k < PHI_ARRAYS; ++k)",
            "    for (int side = 0; side < PHI_SIDES; ++side)",
            "        s->y[side][k] = k < PHI_DIM ? memory + (size_t)(PHI_SIDES * k + side) * block : s->x[k];",
            "memory += PHI_SIDES * PHI_DIM * block;",
        ),
    ),
    StateBlock(
        "y",
        "SERIES && ADJOINT",
        (
            "double *y[3][PHI_ARRAYS];"
            " /* three solutions of a stage, each with parameters at sites: before a sweep, after it, and in the"
            " reverse pass */",
            "double *const *side; /* right-hand side while the equation of the cotangents is solved, else NULL */",
            "double *const *handed, *shares;"
            " /* contributions to cotangents of other sites; partial sums of row segments */",
            "int wide;                 /* 1 if the cotangents use full-range functions */",
        ),
        reset=("memcpy(s->y[2], s->x, sizeof s->x);",),
    ),
    StateBlock(
        "y",
        "SERIES && SLOPES && !ADJOINT",
        (
            "double *y[2][PHI_ARRAYS];"
            " /* two solutions of a stage, each with parameters at sites: before and after a sweep of all sites */",
        ),
    ),
    StateBlock(
        "y",
        "SERIES && !SLOPES && !ADJOINT",
        (
            "double *y[3][PHI_ARRAYS];"
            " /* three solutions of a stage, each with parameters at sites: before a sweep, after it, and perturbed */",
        ),
    ),
    StateBlock(
        "predictor",
        "SERIES && SWEEP_PREDICTORS",
        ("phi_predictor PHI_OF(predictor, PHI_STAGES); /* predictor of each stage */",),
        reset=(
            "PHI_EACH_STAGE",
            "    for (int d = 0; d < PHI_DIFFERENCES; ++d)",
            "        for (int k = 0; k < PHI_DIM; ++k, memory += block)"
            " PHI_OF(s->predictor, stage).difference[d][k] = memory;",
        ),
    ),
    StateBlock(
        "sweeps",
        "SERIES",
        (
            "size_t sweeps;            /* number of sweeps of all stages since phi_init */",
            "int stiff;                /* 1 if fixed-point sweeps have failed, so that Newton's method is used */",
            "double usual[PHI_DIM];    /* magnitudes of the fields of y */",
        ),
    ),
    StateBlock(
        "matrix",
        "SERIES && BANDED",
        (
            "const double *factored;   /* the coefficients for which the matrix was factorised, or NULL */",
            "double *v[PHI_DIM];       /* a direction of Newton's method */",
            "double *matrix;           /* the factorised band matrix, see phi_factorise */",
        ),
        reset=("for (int k = 0; k < PHI_DIM; ++k, memory += block) s->v[k] = memory;",),
    ),
    StateBlock(
        "block",
        "SERIES && KRYLOV && SITE_BLOCKS",
        (
            "double *block[PHI_DIM * PHI_DIM], *solved[PHI_DIM];"
            " /* preconditioner: inverses of the diagonal blocks; their products with a vector */",
        ),
        reset=(
            "for (int k = 0; k < PHI_DIM * PHI_DIM; ++k, memory += block) s->block[k] = memory;",
            "for (int k = 0; k < PHI_DIM; ++k, memory += block) s->solved[k] = memory;",
        ),
    ),
    StateBlock(
        "space",
        "SERIES && KRYLOV",
        (
            "double *space[PHI_DIRECTIONS + 1][PHI_DIM], *sums;"
            " /* basis of the Krylov space, sums over row segments: see phi_krylov */",
        ),
        reset=(
            "for (int d = 0; d <= PHI_DIRECTIONS; ++d)",
            "    for (int k = 0; k < PHI_DIM; ++k, memory += block) s->space[d][k] = memory;",
            "s->sums = memory;",
        ),
    ),
    StateBlock(
        "kinds",
        "SEAMS",
        (("double *kinds; /* for each site, its colour and its seams as one number */"),),
        reset=("s->kinds = memory;",),
    ),
    StateBlock("steps", members=("size_t steps;             /* number of successful steps since phi_init */",)),
    StateBlock(
        "t",
        "TIMED",
        (
            "double t;                 /* the time of the state */",
            "double now;               /* the time of the present stage, at which H is evaluated */",
        ),
    ),
    StateBlock("t", "!TIMED && !MONITOR", ("double t;                 /* time since phi_init */",)),
    StateBlock(
        "t", "MONITOR", ("double t;                 /* physical time since phi_init; steps are equal in tau */",)
    ),
    StateBlock("h", members=("double h;                 /* size of the last step */",)),
    StateBlock(
        "noise",
        "NOISE",
        (
            "uint64_t seed, first_step; /* seed of the noise, number of the first step after phi_init */",
            "uint32_t member;",
        ),
    ),
    StateBlock(
        "planes",
        "NOISE && BY_HAND",
        (
            "uint64_t first_plane, planes;"
            " /* index of this solver's first plane, and number of planes, in the whole lattice; 0 before"
            " phi_set_planes */",
        ),
    ),
    StateBlock(
        "stop",
        "ADJOINT",
        ("int (*stop)(void);        /* called between steps to ask whether to stop, see phi_ask; or NULL */",),
    ),
    StateBlock(
        "tape",
        "ADJOINT && SERIES",
        ("double *tape;             /* tape to which a step writes the solutions of its stages, or NULL */",),
    ),
    StateBlock(
        "tape",
        "ADJOINT && !SERIES && !RECOMPUTED",
        (("double *tape; /* tape to which steps write the values that their sweeps overwrite, or NULL */"),),
    ),
    StateBlock(
        "tangents",
        "TANGENT",
        (
            "size_t vectors;           /* number of tangent vectors that flows act on */",
            "double *tangents;         /* the fields of the first vector, in rows, then those of the others */",
        ),
    ),
    StateBlock(
        "coef",
        members=(
            "phi_params params;        /* the parameters, set by phi_init */",
            "double coef[PHI_COEFFICIENTS]; /* functions of params and h */",
            "int prepared;             /* 1 if coef has been computed */",
        ),
    ),
    StateBlock(
        "before_h",
        "!MONITOR",
        (
            "size_t steps_before_h; /* steps and t at the last change of h: t = t_before_h + (steps since then) h */",
            "double t_before_h;",
        ),
    ),
)

#: Members of the C struct that describes a row segment, in blocks that depend on features. Loops over the sites of the
#: segment receive the struct as an argument. The statements in ``reset`` initialise the struct for a whole row of a
#: solver s.
ROW = (
    StateBlock(
        "x",
        members=("const phi_solver *s;", "double *const *x;             /* fields and parameters, as in phi_solver */"),
        reset=("row.s = s;", "row.x = s->x;"),
    ),
    StateBlock(
        "at",
        "!ONE_ROW",
        ("const ptrdiff_t *at; /* offsets of the row and of its neighbouring rows from the first row, in doubles */",),
        reset=("row.at = s->lines + index * PHI_LINES;",),
    ),
    StateBlock(
        "sites",
        members=("ptrdiff_t from, to;           /* first site of the segment, and the one after the last */",),
        reset=("row.from = 0;", "row.to = s->length;"),
    ),
    StateBlock(
        "stage",
        "SERIES",
        ("double *const *start, *const *out; /* state before a stage, and the result; x holds the solution y */",),
        reset=("row.start = row.out = s->x;",),
    ),
    StateBlock(
        "varied",
        "SERIES && SLOPES || TANGENT",
        ("double *const *varied;        /* tangent vector: a variation of x */",),
    ),
    StateBlock(
        "bar",
        "ADJOINT",
        (
            "double *const *bar, *const *handed;"
            " /* cotangents of x, and contributions to neighbouring sites: see phi_transpose */",
        ),
        reset=("row.bar = row.handed = NULL;",),
    ),
    StateBlock(
        "received",
        "ADJOINT && TAKES",
        ("double *const *received;      /* contributions that neighbouring sites have stored in an earlier flow */",),
        reset=("row.received = NULL;",),
    ),
    StateBlock(
        "givers",
        "GIVERS",
        ("ptrdiff_t givers[PHI_LINES];  /* offsets of the rows whose sites contribute to cotangents of this row */",),
    ),
    StateBlock(
        "chosen",
        "BY_COLOUR",
        ("int chosen;                   /* the flow is that of the terms of H at sites of this colour */",),
        reset=("row.chosen = 0;",),
    ),
    StateBlock(
        "present",
        "OPEN && !ONE_ROW",
        (
            "double present[PHI_WEIGHTS];"
            " /* for each term of H, 0 if it reaches beyond an open end of an axis across the row, else 1 */",
        ),
    ),
    StateBlock(
        "complete",
        "OPEN && BESIDE && !ONE_ROW",
        ("int complete;                 /* whether all terms of H are present */",),
    ),
    StateBlock(
        "window",
        "SEAMS",
        ("double window;                /* the seams of the present sweep, encoded as in `kinds` of phi_solver */",),
        reset=("row.window = 0.0;",),
    ),
    StateBlock(
        "near_seams",
        "SEAMS && !ONE_ROW",
        ("int near_seams; /* bit a is 1 if the row is near the seam of axis a; the last axis has no bit */",),
    ),
    StateBlock(
        "colour",
        "COLOURS && !ONE_ROW",
        ("int colour;                   /* colour of the first site */",),
        reset=("row.colour = 0;",),
    ),
    StateBlock(
        "swept_colour",
        "COLOURS && SWEPT",
        ("int swept;                    /* colour of the sites of the present sweep */",),
        reset=("row.swept = 0;",),
    ),
)
