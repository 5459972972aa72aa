#ifndef PHI_FILE_ADJOINT_SEGMENT_H
#define PHI_FILE_ADJOINT_SEGMENT_H
enum {
    PHI_SEGMENT = PHI_STEPS_OF_SEGMENT((2 * PHI_BACK_GROUP + PHI_FLOWS - 1) / PHI_FLOWS) /* steps of a segment; with so many, the states that a batch stores fit into the tape of one member */
};
#endif
