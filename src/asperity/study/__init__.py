"""A whole study of a wall: its result, its report and its pictures."""

from .result import StudyResult, TracerCheck
from .study import DATA, FORMATS, PICTURES, SavedStudy, Study, check_tracer, picture_names, prepare_folder, study_wall
from .surfaces import SurfaceStudy, study_surface

__all__ = [
    "DATA",
    "FORMATS",
    "PICTURES",
    "SavedStudy",
    "Study",
    "StudyResult",
    "SurfaceStudy",
    "TracerCheck",
    "check_tracer",
    "picture_names",
    "prepare_folder",
    "study_surface",
    "study_wall",
]
