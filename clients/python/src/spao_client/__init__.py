"""Volumes, scenes and live pictures of a spao-server."""

from .client import Client, Document, Scene, SpaoError
from .stream import Frame, Stream, merge_patch

__all__ = ["Client", "Document", "Frame", "Scene", "SpaoError", "Stream", "merge_patch"]
