"""A store that cannot be used. Requests that are refused raise ``rackhand.schemas.refusal.RequestRefused``."""

from __future__ import annotations


class StoreError(Exception):
    """The store file cannot be used: foreign, corrupt, newer, of another robot, or held by another planner.

    Nothing in the file was changed.
    """
