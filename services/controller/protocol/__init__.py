"""The text of requests and answers (spec motion-controller §1 and §2). Read in this order:

parse          a text to a typed request, or the error for it
answers        the three shapes of an answer
dispatch       ``Dispatcher``: retries, priority access, checks
context        what commands that are executed here work with
sessions       clients, their connections and public names
idempotence    answers that are kept for retries
status_stream  when a status stream sends
reading        long requests, parsed beside the control loop
"""
