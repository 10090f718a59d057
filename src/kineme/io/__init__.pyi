# Recordings
from kineme.io.reading.merge_files import Recordings as Recordings

__all__: list[str]
