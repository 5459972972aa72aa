"""Attitudes and positions of bodies: the group element whose coadjoint action on the dual of a Lie algebra is a
step."""
