"""Ways round a narrow valley: stiff lines that a difficult solve begins with softened, and stiffens by degrees."""

# A soft line is stretched to twice its length by SOFT times the load at first, then by STIFFENING times more each time;
# no load counts as less than SMALLEST_LOAD of the largest k l0. Chosen on random networks of ropes.
SOFT, STIFFENING, SMALLEST_LOAD = 3.0, 30.0, 1e-9


def softened_stages(groups, load):
    """The groups with lines and ropes that are softer than they are by degrees, the softest first; none without load.

    A soft line has a spring in series, k' = k P / (P + k l0), P the load N that stretches that spring by l0.
    """
    largest = max((group.softenable() for group in groups), default=0.0)
    stages = []
    spring = SOFT * max(load, SMALLEST_LOAD * largest)
    while 0.0 < load < float("inf") and spring < largest:
        stages.append(tuple(group.softened(spring) for group in groups))
        spring *= STIFFENING
    return stages
