"""One simulated arm. Read ``arm`` (commands in, measurements out), then ``servo`` (its joint servo, compiled)."""
