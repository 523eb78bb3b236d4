"""Memory of a long log: what is no longer wanted goes back to the system at once."""

import os

#: Arrays from this size on have memory of their own, which goes back with them. [bytes]
#:
#: Each page of such memory has to be found and cleared anew: of smaller arrays, which come by the
#: thousand, that took a third of the time of an hour's report and made its peak no lower.
LARGE = 1 << 26

#: The number by which the C library knows the size from which memory is mapped.
MMAP_THRESHOLD = -3


def give_back() -> None:
    """Have freed arrays give their memory back, as far as the C library can be told.

    Otherwise it keeps what it once had, and a long log's peak is the sum of all its stages.
    """
    # Read by pyarrow when it is imported; its own allocator keeps what it once had.
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    import ctypes

    try:
        ctypes.CDLL(None).mallopt(MMAP_THRESHOLD, LARGE)
    except (AttributeError, OSError, TypeError):  # another C library
        return
