"""Walls of flows: plates, cylinders, pipes, spheres, aerofoils and a wing on a body, each with its normals by formula. layered.Maker
makes meshes above them."""
import numpy as np
from layered import Pipe, Ring, Sphere


def turn(x):
    """So that nothing lies along an axis."""
    a, b = 0.3, 0.7
    about_z = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    return about_z @ about_x @ x


class Plate:
    flat, whole, top = False, False, 1.0
    boxes = (3, 2)

    def at(self, around, along, height):
        return turn(np.array([2 * around, height, 1.5 * along]))

    def normal(self, around, along):
        return turn(np.array([0, 1.0, 0]))


class FlatPlate(Plate):
    flat, boxes = True, (3, 1)

    def at(self, around, along, height):
        return np.array([2 * around - 0.3 * height, 0.5 * around + height, 0])

    def normal(self, around, along):
        return np.array([-0.5, 2, 0]) / np.hypot(0.5, 2)


class Circle(Ring):
    boxes = (12, 1)

    def normal(self, around, along):
        return np.array([np.sin(2 * np.pi * around), np.cos(2 * np.pi * around), 0])


class Cylinder(Pipe):
    def __init__(self):
        super().__init__()
        self.boxes = (4, 2)

    def normal(self, around, along):
        return np.array([np.sin(np.pi / 2 * around), np.cos(np.pi / 2 * around), 0])


class Inside(Cylinder):
    """Inside a pipe of radius 1."""
    top = 0.5

    def at(self, around, along, height):
        return (1 - height) * super().normal(1 - around, along) + [0, 0, 0.6 * along]

    def normal(self, around, along):
        return -super().normal(1 - around, along)


class Ball(Sphere):
    boxes = (3, 3)

    def normal(self, around, along):
        x = self.at(around, along, 0)
        return x / np.linalg.norm(x)


class Aerofoil:
    """NACA 0012, whose trailing edge is sharp, or with a base at its trailing edge. Columns at edges rise between the normals of both
    sides, and in the elements beside them directions pass from that to the normal."""
    flat, whole, top = True, True, 0.2
    POWERS = {1: 0.2969, 2: -0.126, 4: -0.3516, 6: 0.2843, 8: -0.1036}  # of the root of x

    def __init__(self, base=0.0):
        self.base = base
        self.count = 24 + (1 if base else 0)
        self.boxes = (self.count, 1)
        self.edges = (0, 24) if base else (0,)

    def curve(self, around):
        """Point and derivative; the wall runs from the trailing edge along the lower side and back above."""
        element = around * self.count
        if element > 24:
            low, high = self.curve(24 / self.count)[0], self.curve(0)[0]
            return low + (element - 24) * (high - low), high - low
        root, slope = 1 - element / 12, -1.0  # of x, with the sign of y
        sign = 1 if root > 0 else -1
        y = sum(0.6 * factor * sign * abs(root) ** power for power, factor in self.POWERS.items()) + self.base * root * abs(root)
        rise = sum(0.6 * factor * power * abs(root) ** (power - 1) for power, factor in self.POWERS.items())
        rise += 2 * self.base * abs(root)
        return np.array([root**2, -y, 0]), np.array([2 * root * slope, -rise * slope, 0])

    def side(self, around, to):
        """The normal a little before or behind a place."""
        slope = self.curve((around + to * 1e-7) % 1.0)[1]
        return np.array([-slope[1], slope[0], 0]) / np.hypot(*slope[:2])

    def normal(self, around, along):
        """None at a sharp edge."""
        element = round(around * self.count * 1e6) / 1e6 % self.count
        return None if element in self.edges else self.side(around, 0)

    def direction(self, around):
        element = around * self.count % self.count
        below = min(int(element), self.count - 1)
        ends = []
        for vertex in (below, below + 1):
            place = vertex / self.count % 1.0
            if vertex % self.count in self.edges:
                between = self.side(place, -1) + self.side(place, 1)
                ends.append(between / np.linalg.norm(between))
            else:
                ends.append(self.side(place, 0))
        if below % self.count in self.edges or (below + 1) % self.count in self.edges:
            return ends[0] + (element - below) * (ends[1] - ends[0])
        return self.side(around, 0)

    def at(self, around, along, height):
        around %= 1.0
        return self.curve(around)[0] + height * self.direction(around)

    def is_fixed(self, around, along):
        return False


class Wing(Aerofoil):
    """The same with a span."""
    flat = False

    def __init__(self, base=0.0):
        super().__init__(base)
        self.boxes = (self.count, 1)

    def at(self, around, along, height):
        return super().at(around, along, height) + [0, 0, 0.5 * along]


class Junction(Wing):
    """A wing that stands on a plane: both are walls."""

    def __init__(self, base=0.0):
        super().__init__(base)
        self.boxes = (self.count, 2)

    normal_of_body = np.array([0, 0, 1.0])
