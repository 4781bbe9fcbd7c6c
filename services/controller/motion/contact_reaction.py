"""What a contact does to the motion, and what is said of it."""

from __future__ import annotations

from rackhand.schemas.crf_contact import Contact
from rackhand.schemas.motion import ArmState
from rackhand.services.controller import ik
from rackhand.services.controller.motion.contact import ContactWatch, describe
from rackhand.services.controller.motion.driver_watch import CommandDelay
from rackhand.services.controller.motion.executor import MotionExecutor

OVER_NS = 300_000_000  # without a contact, until the next one is news
CATCHING_UP_NS = 300_000_000  # after missed ticks, late commands or a torque, the driver catches up with its command
RELEASE_NS = 200_000_000  # for which a stream of velocities must pause before it moves the arm again


class ContactReaction:
    """Of one arm. ``last``: the contact that the status shows, until the next motion begins."""

    def __init__(self, arm: ik.Arm, motion: MotionExecutor) -> None:
        self._motion = motion
        self.watch = ContactWatch(arm)
        self._delay = CommandDelay(round(motion.period * 1e9))
        self.reset()

    def reset(self) -> None:
        """The arm's states begin anew."""
        self.watch.reset()
        self._delay.reset()
        self.last: Contact | None = None
        self._news: Contact | None = None
        self._touched: int | None = None  # when there was a contact last
        self._blocked_until = self._caught_up = 0

    def see(self, state: ArmState, late: bool) -> Contact | None:
        """The contact as of ``state``, to be called before the tick that answers it. Stops the motion, unless a torque
        moves the arm or the stop condition is switched off. ``late``: ticks were missed."""
        motion = self._motion
        late |= self._delay.late(state)
        if late or motion.hands_over:
            self._caught_up = state.stamp + CATCHING_UP_NS
        contact = self.watch.see(state, motion.q, motion.rotation, catching_up=state.stamp < self._caught_up)
        if contact is None:
            return None
        stops = motion.tuning.stops_on_contact and not (motion.standing or motion.gives_way or motion.by_torque)
        if stops:
            self._blocked_until = state.stamp + RELEASE_NS if motion.follows else 0
            motion.give_way(state)
        else:
            motion.touched()
        contact = contact.model_copy(update={"stopped": stops})
        if stops or self._touched is None or state.stamp - self._touched > OVER_NS:
            self.last = self._news = contact
        self._touched = state.stamp
        return contact

    def refuses(self, now: int) -> str:
        """Why a velocity or torque is not followed: the stream that was stopped by a contact has not paused yet."""
        if now >= self._blocked_until or self.last is None:
            return ""
        self._blocked_until = now + RELEASE_NS
        return f"{describe(self.last)}: pause for {RELEASE_NS / 1e9:g} s before the next"

    def news(self) -> Contact | None:
        """A contact that was not reported yet, once."""
        news, self._news = self._news, None
        return news
