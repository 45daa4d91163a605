"""A whole study of a wall: its result, its report and its pictures."""

from .result import StudyResult, TracerCheck
from .study import DATA, FORMATS, PICTURES, Study, check_tracer, prepare_folder, study_wall

__all__ = [
    "DATA",
    "FORMATS",
    "PICTURES",
    "Study",
    "StudyResult",
    "TracerCheck",
    "check_tracer",
    "prepare_folder",
    "study_wall",
]
