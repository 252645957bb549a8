"""Areas of a stability chart, found by their labels."""

from matplotlib.path import Path


def region(ax, name):
    return next((p for p in ax.patches if str(p.get_label()).startswith(name)), None)


def contains(ax, name, x, y):
    patch = region(ax, name)
    return patch is not None and inside(patch.get_path(), x, y)


def inside(path, x, y):
    """Whether a point is in an odd number of the path's outlines, as it is drawn."""
    return sum(Path(outline).contains_point((x, y)) for outline in path.to_polygons()) % 2 == 1
