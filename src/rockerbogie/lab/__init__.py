"""The page in the browser where a visitor moves, drives and changes a rover on terrain.

`state`, `readings`, `picking`, `charts`, `uploads` and `records` are plain computations. `server` and `session` connect them to a
browser through viser, and the `*_panel` and `*_view` modules hold its controls and its scene.
"""
