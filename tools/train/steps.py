"""Steps to the pixels of a window of 5x5, in the order of src/film/neighbours.rs: opposite steps are side by side."""
STEPS = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1), (2, 0), (-2, 0), (0, 2), (0, -2), (2, 1), (-2, -1), (1, 2),
         (-1, -2), (2, -1), (-2, 1), (1, -2), (-1, 2), (2, 2), (-2, -2), (2, -2), (-2, 2)]
CROSS = 4


def forward(step):
    """Whether a step leads to pixels of higher index."""
    return step[1] > 0 or step[1] == 0 and step[0] > 0


HALF_PLANE = [step for step in STEPS if forward(step)]
