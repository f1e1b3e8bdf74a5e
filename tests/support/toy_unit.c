/* A unit for the tests of the C face: a mass on a spring, pulled by a force, stepped by the implicit midpoint rule.

   Parameters: mass, stiffness (as exported or less than 1e6), unused, kind (an enumeration), silent, steps at most, number fixed at export.
   Constants: mass, stiffness, offset by kind. Inputs: force, spare. State: position, velocity, number of steps.
   Outputs: position, velocity, steps (group 0), energy (group 1), number of times group 1 was computed in this state's life (never saved). */
#include <stdint.h>

static void note(double *notes, double status, double message, double count, double first, double second) {
    double *at = notes + 1;
    for (int i = 0; i < (int)notes[0]; i++) at += 3 + (int)at[2];
    at[0] = status, at[1] = message, at[2] = count, at[3] = first, at[4] = second;
    notes[0]++;
}

int64_t unit_constants(const double *exported, const double *parameters, double *constants, double *notes) {
    (void)exported;
    constants[0] = parameters[0];
    constants[1] = parameters[1];
    constants[2] = parameters[3] == 2.0 ? 0.5 : 0.0;
    if (parameters[1] < 1e6) return 0;
    note(notes, 3, 0, 1, parameters[1], 0);
    return 3;
}

int64_t unit_start(const double *constants, const double *exported, const double *exported_state, const double *inputs, double time, double *state, double *notes) {
    (void)exported, (void)time;
    for (int i = 0; i < 3; i++) state[i] = exported_state[i];
    state[0] += constants[2];
    if (inputs[0] > 1e6) {
        note(notes, 3, 5, 0, 0, 0);
        return 3;
    }
    if (inputs[0] > 1e3) note(notes, 1, 4, 1, inputs[0], 0);
    return 0;
}

int64_t unit_step(const double *constants, const double *inputs, double time, double h, const double *state, double *next, double *notes) {
    double m = constants[0], k = constants[1], x = state[0], v = state[1];
    if (h > 10.0) {
        note(notes, 2, 1, 2, h, time);
        return 2;
    }
    if (h == 9.0) return 2; /* without a word */
    double change = (inputs[0] - k * (x + 0.5 * h * v)) * h / (m + 0.25 * k * h * h);
    next[0] = x + h * (v + 0.5 * change);
    next[1] = v + change;
    next[2] = state[2] + 1.0;
    if (h > 5.0) {
        note(notes, 1, 2, 2, 7.0, h);
        note(notes, 1, 3, 1, 6.0, 0);
    }
    return 0;
}

void unit_outputs(const double *constants, const double *state, int64_t group, double *outputs) {
    if (group == 0) {
        for (int i = 0; i < 3; i++) outputs[i] = state[i];
    } else {
        outputs[3] = 0.5 * (constants[0] * state[1] * state[1] + constants[1] * state[0] * state[0]);
        outputs[4] += 1.0;
    }
}
