"""The contract of the cell: messages, topics, fail reasons and error codes. Imports nothing else of rackhand.

Read in this order: ``base`` (the base class of messages), ``codec`` (msgpack), ``service`` (liveliness), ``chassis``,
``parameters``, ``moves``, ``maps``, ``world``, ``motion`` (messages by subject), ``topics`` (the table of topics and
queries), ``refusal`` and ``fail_reasons``; ``websocket`` (frames of the gateway); ``crf_requests``, ``crf``,
``crf_framing``, ``orientation`` (the CRF protocol); ``planar``, ``scan_points``, ``fencing`` (rules that several
services share).
"""
