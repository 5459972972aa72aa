"""Attitudes and positions: the group element whose coadjoint action is a step on the dual of a Lie algebra."""
