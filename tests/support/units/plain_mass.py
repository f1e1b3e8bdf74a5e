"""A unit as users write them with PythonFMU: a mass on a spring by steps of its own (semi-implicit Euler); it takes no step back, tells no
derivative and no energy."""

import math

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class PlainMass(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.mass, self.stiffness, self.damping = 6e6, 1e6, 5e5
        self.parts, self.push, self.start = 1.0, 0.0, 0.0
        self.f, self.rest, self.x, self.v, self.mean = ([0.0] * 3 for _ in range(5))
        for name in ("mass", "stiffness", "damping", "parts", "push", "start"):
            parameter = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.tunable}
            self.register_variable(Real(name, start=getattr(self, name), **parameter))
        for port, values, causality in (("force", self.f, "input"), ("velocity", self.mean, "output"), ("position", self.x, "output")):
            for i in range(3):
                self._register(f"{port}[{i + 1}]", values, i, Fmi2Causality[causality])

    def _register(self, name, values, i, causality):
        setting = {"setter": lambda value: values.__setitem__(i, value), "start": 0.0} if causality == Fmi2Causality.input else {}
        self.register_variable(Real(name, causality=causality, getter=lambda: values[i], **setting))

    def exit_initialization_mode(self):
        self.rest = list(self.f)  # its spring holds what pulls at rest
        self.v[2] = self.mean[2] = self.start

    def do_step(self, time, step):
        count, before = int(self.parts), list(self.x)
        h = step / count
        for k in range(count):
            t = time + (k + 0.5) * h
            load = self.push * math.sin(0.2 * math.pi * t) * min(1.0, t / 10.0)
            for i in range(3):
                force = self.f[i] - self.rest[i] + load * (i == 2) - self.stiffness * self.x[i] - self.damping * self.v[i]
                self.v[i] += h * force / self.mass
                self.x[i] += h * self.v[i]
        for i in range(3):
            self.mean[i] = (self.x[i] - before[i]) / step
        return True
