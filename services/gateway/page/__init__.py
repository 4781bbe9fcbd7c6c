"""The web page. ``index`` serves ``index.html``, ``page.css`` and the scripts.

Read the scripts in this order: ``page.js`` (start), ``wire.js`` (HTTP and WebSocket), ``view.js`` and ``pen.js``
(coordinates, drawing), ``draw.js``, ``overlays.js``, ``gestures.js`` (mouse and touch), ``panel.js`` (the side panel).
"""
