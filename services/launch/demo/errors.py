"""Why the story could not go on."""

from __future__ import annotations


class StoryError(Exception):
    """A step failed; the text says what was asked, what was answered, and what was expected."""
