"""Roles of kernels, the functions that a program evaluates: each role belongs to one group or to none. The group
determines which arrays the loops over sites read.
"""

import pytest

from phigen.scheme.kernel import Role

GROUPS = ("is_sweep", "is_stage", "is_observable", "is_transposed_stage")
ALONE = {Role.OTHER, Role.GATHER, Role.TRANSPOSED_SWEEP, Role.TRANSPOSED_GATHER}


@pytest.mark.parametrize("role", Role)
def test_each_role_belongs_to_one_group_or_stands_alone(role):
    assert sum(getattr(role, group) for group in GROUPS) == (role not in ALONE)


def test_transposes_have_the_roles_of_what_they_transpose():
    assert Role.SWEEP.transposed is Role.TRANSPOSED_SWEEP
    assert Role.RELAX.transposed.is_transposed_stage
    assert Role.ADVANCE.transposed.is_transposed_stage
    with pytest.raises(KeyError):
        Role.ENERGY.transposed  # noqa: B018
