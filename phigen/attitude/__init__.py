"""The group element that a step on the dual of a Lie algebra is the coadjoint action of: attitude and position."""
