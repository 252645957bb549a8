"""What campaigns by hand print: each difference when it is found, and totals as they go on."""


def count_differences(differences, count, first):
    """Call ``differences(seed)``, which gives how many were compared and words on each that differs, for many seeds."""
    total, wrong = 0, 0
    for done, seed in enumerate(range(first, first + count), start=1):
        compared, words = differences(seed)
        total, wrong = total + compared, wrong + len(words)
        for word in words:
            print(word, flush=True)
        if done % 10 == 0 or done == count:
            print(f"{done} seeds: {total} compared, {wrong} differ", flush=True)
