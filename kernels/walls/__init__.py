"""The laws of walls: closed forms, exact laws of polygons, and conditional distributions by tracing."""
