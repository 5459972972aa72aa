"""Structs of the C runtime whose members depend on switches, as lists of blocks (see `phigen.targets.state`)."""

from __future__ import annotations

from phigen.targets.state import StateBlock

#: Members of the struct for a block of steps in SIMD lanes: coefficients and predictors.
TABLE = (
    StateBlock(
        "fits",
        members=(
            "int PHI_OF(fits, PHI_STAGES); /* number of the fit that gave the weights; -1 before the first fit */",
            "phi_lanes PHI_OF(coef, PHI_STAGES)[PHI_COEFFICIENTS], PHI_OF(weight, PHI_STAGES)[PHI_WINDOW][PHI_DIM];",
        ),
    ),
    StateBlock(
        "march",
        "COMPOSED && !PATH",
        (
            "int marching; /* 1 if the last steps were a block; slope then has dx/dt at their starts */",
            "double slope[PHI_DIM][PHI_SLOPES];",
        ),
    ),
)

#: Members of the struct for one stage of a block of steps, with one step in each SIMD lane: the solution of the stage,
#: and its corrections by Newton's method.
MODEL = (
    StateBlock(
        "y",
        members=("phi_lanes y[PHI_DIM], displacement[PHI_DIM], increment[PHI_DIM], residual[PHI_DIM];",),
    ),
    StateBlock(
        "factors",
        "SPARSE",
        (
            "/* LU factors of the Jacobian of alpha(y); Jacobian of the increment; corrections of the increment */",
            "phi_lanes factor[PHI_FACTORS], slope[PHI_DIM * PHI_DIM], gained[PHI_DIM];",
        ),
    ),
    StateBlock(
        "inverse",
        "!SPARSE && CENTRED",
        ("phi_lanes inverse[PHI_DIM * PHI_DIM]; /* for a residual r of alpha(y) = x, y is corrected by -inverse r */",),
    ),
    StateBlock(
        "inverse_and_gain",
        "!SPARSE && !CENTRED",
        (
            "/* for a residual r of alpha(y) = x, y is corrected by -inverse r, and the increment by -gain r */",
            "phi_lanes inverse[PHI_DIM * PHI_DIM], gain[PHI_DIM * PHI_DIM];",
        ),
    ),
    StateBlock(
        "middle",
        "PATH",
        (
            "phi_lanes middle[PHI_DIM]; /* the middle of the path minus y */",
            "phi_lanes alpha_y[PHI_DIM * PHI_DIM], increment_y[PHI_DIM * PHI_DIM];"
            " /* derivatives of alpha and of beta - alpha by y, with p held fixed */",
        ),
    ),
)

#: Struct with the arguments of a run of an ensemble. Each array has one value for each trajectory, or one value for all
#: trajectories.
MEMBERS = (
    StateBlock("t0", "TIMED", ("const double *t0; /* initial times */",)),
    StateBlock("gauge", "GAUGE", ("const double *gauge; /* gauges, or NULL to choose them at the start */",)),
    StateBlock(
        "attitudes",
        "ATTITUDES",
        (
            "double *attitude; /* the attitudes, in the layout of x, or NULL */",
            "double *attitudes; /* receives the attitudes after every stride-th step, or NULL */",
        ),
    ),
    StateBlock(
        "noise",
        "ATTITUDES && NOISE",
        (
            "uint64_t seed, first_step; /* these select the random numbers: see phi_set_noise */",
            "uint32_t first_member;",
        ),
    ),
)

#: Members of the struct for the reverse pass of a step: derivatives of L, the number whose gradient is computed.
COTANGENT = (
    StateBlock(
        "x",
        members=(
            "double x[PHI_DIM]; /* derivatives of L with respect to the state */",
            "double PHI_OF(coef, PHI_STAGES)[PHI_COEFFICIENTS]; /* derivatives of L with respect to coefficients */",
        ),
    ),
    StateBlock("end", "PATH", ("double end[PHI_DIM]; /* the state to which the derivatives x belong */",)),
    StateBlock(
        "after",
        "GAUSS",
        (
            "int chained; /* 1 if `after` has values, else 0 */",
            "double after[PHI_UNKNOWNS][PHI_WIDTH]; /* derivatives of L with respect to unknowns of the next step */",
        ),
    ),
)

#: Members of the C struct ``phi_traced``. The reverse pass stores linearised stages in this struct, one in each SIMD
#: lane.
TRACED = (
    StateBlock(
        "stages",
        members=(
            "phi_lanes *coef, y[PHI_DIM], jacobian[PHI_DIM * PHI_DIM], gain[PHI_DIM * PHI_DIM];",
            "phi_lanes after[PHI_DIM], change[PHI_DIM], wrong;",
        ),
    ),
    StateBlock("path", "PATH", ("phi_lanes start[PHI_DIM];", "phi_expansion e;")),
    StateBlock("t", "RENEWED", ("double t[PHI_LANES]; /* the times of the stages */",)),
)

#: Struct with those arguments of the reverse pass of an ensemble that only some solvers have.
PULLED = (
    StateBlock("t0", "TIMED", ("const double *t0; /* initial times */",)),
    StateBlock("gauge", "!TIMED && GAUGE", ("const double *gauge; /* gauges, or NULL to choose them at the start */",)),
)

#: Members of the struct for the reverse pass of a SIMD batch of trajectories: derivatives of L, the number whose
#: gradient is computed.
BACK_GROUP = (
    StateBlock(
        "x",
        members=("phi_lanes x[PHI_BACK_PACKS][PHI_DIM], PHI_OF(coef[PHI_BACK_PACKS], PHI_STAGES)[PHI_COEFFICIENTS];",),
    ),
    StateBlock("start", "SPLITTING", ("phi_pack start[PHI_BACK_PACKS]; /* the initial states of the members */",)),
    StateBlock(
        "stored",
        "SPLITTING && !RECOMPUTED",
        ("phi_lanes stored[PHI_SEGMENT][PHI_FLOWS][PHI_BACK_PACKS][PHI_DIM]; /* states before flows */",),
    ),
)

#: Members of the struct for the reverse pass of a lattice. Derivatives are those of L, the number whose gradient is
#: computed.
TRANSPOSE = (
    StateBlock(
        "bar",
        members=(
            "double *bar[PHI_BARS];      /* derivatives with respect to fields, then parameters at sites and bonds */",
            "double *row_bar[PHI_BARS];  /* derivatives with respect to one state that the run returned */",
            "double *handed[PHI_HANDED]; /* contributions of sites to derivatives at their neighbours */",
            "double *sums;               /* for each row segment, derivatives with respect to the coefficients */",
        ),
    ),
    StateBlock(
        "tape_of_stages",
        "SERIES",
        ("double *tape;               /* tape: for each step and stage, its solution y, and x if needed */",),
    ),
    StateBlock(
        "states_of_legs",
        "!SERIES && RECOMPUTED",
        (
            "double *tape;               /* states of a segment, one every `leg` steps */",
            "size_t leg;                 /* number of steps between two states on the tape */",
            "int lost;                   /* 1 if inverse flows did not lead back to a state on the tape */",
            "int anew;                   /* 1 if flows are repeated, since inverse flows are inaccurate */",
        ),
    ),
    StateBlock(
        "tape_of_sweeps",
        "!SERIES && !RECOMPUTED",
        (
            "double *tape;               /* tape: for each step and sweep of a segment, the fields that it changes */",
            "double *x[PHI_ARRAYS];      /* fields before the sweep that the reverse pass reached last */",
        ),
    ),
    StateBlock("end", members=("double *end[PHI_DIM];       /* state after all steps of the run */",)),
    StateBlock(
        "last_full_range",
        "!SERIES",
        ("size_t last_full_range;     /* value of s->full_range after all steps */",),
    ),
    StateBlock("block", members=("size_t block;               /* size of a field, in doubles */",)),
    StateBlock("of_step", "!RECOMPUTED", ("size_t of_step;             /* numbers that a step writes to the tape */",)),
    StateBlock("states", members=("double *states;             /* checkpoints: states at the starts of segments */",)),
    StateBlock(
        "marks", "SERIES", ("size_t *marks;              /* for each checkpoint, the number of steps before it */",)
    ),
    StateBlock(
        "marks",
        "!SERIES",
        ("size_t *marks;              /* for each checkpoint, the number of steps before it, and s->full_range */",),
    ),
    StateBlock(
        "counts",
        members=(
            "size_t most, count;         /* largest and present number of checkpoints */",
            "size_t longest;             /* largest number of steps of a segment */",
            "size_t first_step;          /* number of steps made before the run */",
            "size_t unasked;             /* updates of sites since s->stop was called last */",
            "int full_range;             /* 1 if the reverse pass uses full-range functions */",
            "int failed;                 /* 1 if small-argument functions were out of range */",
        ),
    ),
)

#: Members of the struct for one flow of a step of a lattice.
FLOW = (
    StateBlock(
        "part",
        members=(
            "int part;                   /* the part of H */",
            "const double *coef;         /* coefficients of the flow */",
        ),
    ),
    StateBlock(
        "renewed_coef",
        "RENEWED",
        ("double renewed_coef[PHI_ROW]; /* memory for coef, which differs from step to step */",),
    ),
    StateBlock(
        "go",
        "RECOMPUTED && TAKES",
        ("int go;                     /* 0 forward; 1 reverse, even flows; 2 reverse, odd flows */",),
    ),
    StateBlock(
        "go",
        "RECOMPUTED && !TAKES",
        ("int go;                     /* 0 forward; 1 reverse, terms of sites; 2 reverse, terms of neighbours */",),
    ),
    StateBlock(
        "reverse",
        "RECOMPUTED",
        (
            "int row;                    /* in the reverse pass, the row of coefficients */",
            "const struct phi_transpose *g;",
            "double *const *bar;         /* in the reverse pass, the derivatives to transform */",
        ),
    ),
)
