"""Reading a Rerun recording back."""

from pathlib import Path

import rerun.chunk


def rows_of(path: Path, entity: str, ending: str) -> list:
    """All values of one component of an entity, in the order of the file."""
    found = []
    for chunk in rerun.chunk.RrdReader(str(path)).stream():
        if chunk.entity_path == entity:
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                if name.endswith(ending):
                    found += batch.column(name).to_pylist()
    return found


def times_of(path: Path, entity: str, ending: str) -> list[float]:
    """Times of the rows that hold a component of an entity, in the order of the file. [s]"""
    found = []
    for chunk in rerun.chunk.RrdReader(str(path)).stream():
        if chunk.entity_path == entity:
            batch = chunk.to_record_batch()
            if any(name.endswith(ending) for name in batch.schema.names):
                found += [t.total_seconds() for t in batch.column("t").to_pylist()]
    return found
