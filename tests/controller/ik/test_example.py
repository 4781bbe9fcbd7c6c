"""The package's page runs as it stands."""

import doctest

from rackhand.services.controller import ik


def test_the_examples_of_the_package_run() -> None:
    result = doctest.testmod(ik)
    assert result.attempted > 10
    assert result.failed == 0
