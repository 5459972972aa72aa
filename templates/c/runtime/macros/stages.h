#ifndef PHI_FILE_STAGES
#define PHI_FILE_STAGES
/* What code says of the stages of a step. With one stage it has no loop over them, no array of one, and no argument that
   says which: PHI_OF is a place in an array, and with PHI_STAGES its declaration; PHI_IN and PHI_TO go from a pointer to the
   first of several structs, which PHI_ADDRESS makes of their array. */
#if PHI_COMPOSED
#define PHI_EACH_STAGE for (int stage = 0; stage < PHI_STAGES; ++stage)
#define PHI_EACH_STAGE_BACK for (int stage = PHI_STAGES - 1; stage >= 0; --stage)
#define PHI_AND_STAGE , stage
#define PHI_AND_INT_STAGE , int stage
#define PHI_OF(array, stage) array[stage]
#define PHI_ADDRESS(array) array
#define PHI_IN(pointer, stage, member) pointer[stage].member
#define PHI_TO(pointer, stage) pointer + stage
#define PHI_ROW_OF(pointer, stage) pointer + stage * PHI_ROW
#define PHI_ALL_STAGES(number) (int)PHI_STAGES * number
#define PHI_FRACTION(h) phi_fractions[stage] * h
#define PHI_AT_FIRST(pointer) stage == 0 ? pointer : NULL
#else
#define PHI_EACH_STAGE
#define PHI_EACH_STAGE_BACK
#define PHI_AND_STAGE
#define PHI_AND_INT_STAGE
#define PHI_OF(array, stage) array
#define PHI_ADDRESS(array) &array
#define PHI_IN(pointer, stage, member) pointer->member
#define PHI_TO(pointer, stage) pointer
#define PHI_ROW_OF(pointer, stage) pointer
#define PHI_ALL_STAGES(number) number
#define PHI_FRACTION(h) h
#define PHI_AT_FIRST(pointer) pointer
#endif
#endif
