"""Structs of the runtime in C whose members depend on switches, as blocks like those of `phigen.targets.state`."""

from __future__ import annotations

from phigen.targets.state import StateBlock

#: Coefficients and predictors of a block of steps, in SIMD lanes.
TABLE = (
    StateBlock(
        "fits",
        members=(
            "int PHI_OF(fits, PHI_STAGES); /* number of the fit that weight belongs to; -1 for none */",
            "phi_lanes PHI_OF(coef, PHI_STAGES)[PHI_COEFFICIENTS], PHI_OF(weight, PHI_STAGES)[PHI_WINDOW][PHI_DIM];",
        ),
    ),
    StateBlock(
        "march",
        "COMPOSED && !PATH",
        (
            "int marching; /* 1 if the last steps were a block, whose slopes these are */",
            "double slope[PHI_DIM][PHI_SLOPES];",
        ),
    ),
)

#: A stage in SIMD lanes, one for each step of a block, with what corrects it in Newton's method.
MODEL = (
    StateBlock(
        "y",
        members=("phi_lanes y[PHI_DIM], displacement[PHI_DIM], increment[PHI_DIM], residual[PHI_DIM];",),
    ),
    StateBlock(
        "factors",
        "SPARSE",
        (
            "/* factors of the Jacobian of alpha(y); Jacobian of the increment; corrections subtracted from it */",
            "phi_lanes factor[PHI_FACTORS], slope[PHI_DIM * PHI_DIM], gained[PHI_DIM];",
        ),
    ),
    StateBlock(
        "inverse",
        "!SPARSE && CENTRED",
        ("phi_lanes inverse[PHI_DIM * PHI_DIM]; /* a residual r of alpha(y) = x corrects y by -inverse r */",),
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
            "phi_lanes middle[PHI_DIM]; /* the middle of the path, less y */",
            "phi_lanes alpha_y[PHI_DIM * PHI_DIM], increment_y[PHI_DIM * PHI_DIM];"
            " /* of alpha and beta - alpha, with p held fixed */",
        ),
    ),
)

#: The arguments of a run of an ensemble; arrays hold a value for each member, or one for all.
MEMBERS = (
    StateBlock("t0", "TIMED", ("const double *t0; /* initial times */",)),
    StateBlock("gauge", "GAUGE", ("const double *gauge; /* gauges, or NULL to choose them at the start */",)),
    StateBlock(
        "attitudes",
        "ATTITUDES",
        (
            "double *attitude; /* the attitudes, in the layout of x, or NULL */",
            "double *attitudes; /* receives their values after each stride of steps, or NULL */",
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

#: What the reverse pass carries from step to step: derivatives of a number L.
COTANGENT = (
    StateBlock(
        "x",
        members=(
            "double x[PHI_DIM]; /* by the state */",
            "double PHI_OF(coef, PHI_STAGES)[PHI_COEFFICIENTS]; /* by the coefficients of each stage */",
        ),
    ),
    StateBlock("end", "PATH", ("double end[PHI_DIM]; /* the state at which x is taken */",)),
)

#: Linearised stages in SIMD lanes.
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

#: The arguments of a reverse pass of an ensemble that depend on features.
PULLED = (
    StateBlock("t0", "TIMED", ("const double *t0; /* initial times */",)),
    StateBlock("gauge", "!TIMED && GAUGE", ("const double *gauge; /* see phi_members */",)),
)

#: What the reverse pass of a batch of members carries from step to step: derivatives of L, as in phi_cotangent.
BACK_GROUP = (
    StateBlock(
        "x",
        members=("phi_lanes x[PHI_BACK_PACKS][PHI_DIM], PHI_OF(coef[PHI_BACK_PACKS], PHI_STAGES)[PHI_COEFFICIENTS];",),
    ),
    StateBlock("start", "SPLITTING", ("phi_pack start[PHI_BACK_PACKS]; /* the members at their starts */",)),
    StateBlock(
        "kept",
        "SPLITTING && !UNDONE",
        ("phi_lanes kept[PHI_SEGMENT][PHI_FLOWS][PHI_BACK_PACKS][PHI_DIM]; /* states before flows */",),
    ),
)
