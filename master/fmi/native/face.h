/* What unit.c, a unit with its data, and face.c, the functions of FMI, have in common. */
#ifndef FACE_H
#define FACE_H
#include <stdint.h>
#include <string.h>

enum { OK, WARNING, DISCARD, ERROR };
enum { INPUT, OUTPUT, PARAMETER };
enum { REAL, INTEGER, BOOLEAN, STRING };
enum { ABOVE_MINIMUM = 1, BELOW_MAXIMUM = 2, FIXED = 4, COUNT = 8 };
enum { NEW, INITIALISING, INITIALISED, TERMINATED };
enum { N_NOTES = 256 };

/* The unit. A note is a line for the log: status, number of a message, count of its values, values; before all of them stands their number. */
extern int64_t unit_constants(const double *exported, const double *parameters, double *constants, double *notes);
extern int64_t unit_start(const double *constants, const double *exported, const double *exported_state, const double *inputs, double time,
                          double *state, double *notes);
extern int64_t unit_step(const double *constants, const double *inputs, double time, double h, const double *state, double *next, double *notes);
extern void unit_outputs(const double *constants, const double *state, int64_t group, double *outputs);

typedef void (*Logger)(void *environment, const char *name, int status, const char *category, const char *message, ...);
typedef struct {
    int64_t causality, kind, index, group, name, rule, flags, items;
    double minimum, maximum;
    int64_t reserved[2];
} Variable;

typedef struct { /* of unit.bin, behind its head */
    int64_t n_constants, n_state, n_inputs, n_outputs, n_parameters, n_groups, n_variables, n_messages, n_text, guid, name;
} Sizes;

typedef struct {
    char *bytes;
    Sizes n;
    const double *constants, *state, *inputs, *parameters; /* as exported */
    const Variable *variables;
    const int64_t *messages;
    const char *text;
} Unit;

typedef struct State {
    struct State *next;
    uintptr_t handle;
    int64_t phase, ready;
    double time, values[]; /* parameters, inputs, state of the unit */
} State;

typedef struct {
    Unit unit;
    char *name;
    Logger logger;
    void *environment;
    int logging, phase, ready; /* ready: `state` is that of an initialised unit */
    double time, stop;
    double *parameters, *inputs, *state, *next, *outputs;
    double *constants, *built, *spare; /* constants, the parameters that they are of, room for other ones */
    double notes[N_NOTES];
    uint64_t fresh; /* one bit for a group of outputs */
    State *states;
    uintptr_t last_handle;
} Instance;

/* Log a line, with '%' doubled; answer `status`. */
int report(Instance *it, int status, const char *format, ...);
#define refuse(it, ...) report(it, ERROR, __VA_ARGS__)

/* Log the notes that the unit has left. */
void tell(Instance *it);

/* Log them or, where there is none, `otherwise`; answer `status`. */
int tell_refusal(Instance *it, int status, const char *otherwise);

/* `value` by a printf directive of doubles, with a dot in every locale. */
void print_number(char *text, size_t room, const char *directive, double value);

/* The shortest decimal number that is `value`, as Python writes it. */
const char *print_shortest(char text[40], double value);
#define SHORTEST(value) print_shortest((char[40]){0}, value)

/* Read resources/unit.bin, whatever form the location has. */
int load_unit(Instance *it, const char *location);

/* Make `constants` those of `parameters`; they stay what they are where the parameters are refused. */
int build_constants(Instance *it, const double *parameters);

/* OK, or `status` with the name of an input that is not finite. */
int check_inputs(Instance *it, int status);

/* Initialise the unit unless it is, with what is set. Its warnings stay in `notes`. */
int make_ready(Instance *it);

static inline void swap(double **one, double **other) {
    double *kept = *one;
    *one = *other;
    *other = kept;
}

static inline void copy(double *to, const double *from, int64_t n) { memcpy(to, from, (size_t)n * sizeof *to); }

static inline int equal(const double *one, const double *other, int64_t n) { return !memcmp(one, other, (size_t)n * sizeof *one); }

static inline int within(int64_t index, int64_t n) { return index >= 0 && index < n; }

static inline uint64_t checksum(const char *bytes, size_t size) { /* FNV-1a */
    uint64_t sum = 0xcbf29ce484222325u;
    for (size_t i = 0; i < size; i++) sum = (sum ^ (unsigned char)bytes[i]) * 0x100000001b3u;
    return sum;
}

static inline const char *text_at(const Unit *unit, int64_t offset) { return unit->text + offset; }

#endif
