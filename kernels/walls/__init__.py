"""The laws of walls: closed forms, exact polygons, and conditional distributions by tracing."""
