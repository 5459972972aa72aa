#ifndef PHI_FILE_SIDES
#define PHI_FILE_SIDES
/* What a factor, given less 1, adds to an element of a group: one of a step, and one from the other side. */
#if PHI_POSITION && PHI_SPATIAL
#define PHI_ADDED(element, factor, change) phi_added_left(element, factor, change)
#define PHI_ADDED_ASIDE(element, factor, change) phi_added_right(element, factor, change)
#elif PHI_POSITION
#define PHI_ADDED(element, factor, change) phi_added_right(element, factor, change)
#define PHI_ADDED_ASIDE(element, factor, change) phi_added_left(element, factor, change)
#elif PHI_SPATIAL
#define PHI_ADDED(element, factor, change) phi_group_product(factor, element, change)
#define PHI_ADDED_ASIDE(element, factor, change) phi_group_product(element, factor, change)
#else
#define PHI_ADDED(element, factor, change) phi_group_product(element, factor, change)
#define PHI_ADDED_ASIDE(element, factor, change) phi_group_product(factor, element, change)
#endif
#endif
