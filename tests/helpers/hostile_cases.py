"""Registry of hostile files: functions that write one, by the name of the file, and the table to read from it."""

import random

CASES = {}


def case(name, *, table=None):
    """Register a function that writes one file."""

    def register(write):
        CASES[name] = (write, table)
        return write

    return register


def flipped(content, seed, count=12):
    """Bytes of a sound file with some changed, most of them where it describes itself."""
    chance, found = random.Random(seed), bytearray(content)
    for _ in range(count):
        place = chance.randrange(min(len(found), chance.choice([64, 400, 3000, 10**9])))
        found[place] = chance.choice([0, 1, 127, 255, chance.randrange(256)])
    return bytes(found)


def damaged(ending, sound):
    """Six damaged copies of a sound file."""
    for seed in range(6):

        def write(path, seed=seed):
            sound(path)
            path.write_bytes(flipped(path.read_bytes(), seed))

        CASES[f"damaged-{seed}{ending}"] = (write, None)
