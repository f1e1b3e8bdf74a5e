/* FMI 2.0 co-simulation face of a unit in machine code: needs the C library alone.

   It holds the rules of FMI (phases, value references, states, messages); the physics are the four unit_ functions that it is linked with, the
   data are those of resources/unit.bin (see tables.py), read once when an instance is made. It starts no thread and no process, changes no
   global, and allocates memory for new instances and new states only. All numbers of a unit are doubles. */
#include "face.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#ifdef _WIN32
#define FMI __declspec(dllexport)
#else
#define FMI __attribute__((visibility("default")))
#endif

static const char *const PHASES[] = {"not initialised", "initialising", "initialised", "terminated"};
static const char *const KINDS[] = {"Real", "Integer", "Boolean", "String"};
static const double TIME_TOLERANCE = 1e-6; /* of a step: hosts add up their time in ways of their own */
static const double TIME_ROUNDING = 1e-12; /* of the time, however short the step */

typedef unsigned Reference;
typedef struct {
    Logger logger;
    void *allocate, *release, *step_finished;
    void *environment;
} Callbacks;

/* life cycle */

static void reset(Instance *it) {
    const Unit *unit = &it->unit;
    it->phase = NEW;
    it->ready = 0;
    it->fresh = 0;
    it->notes[0] = 0;
    it->time = 0;
    it->stop = INFINITY;
    copy(it->parameters, unit->parameters, unit->n.n_parameters);
    copy(it->inputs, unit->inputs, unit->n.n_inputs);
}

static int allocate(Instance *it) {
    const Sizes *n = &it->unit.n;
    struct { double **place; int64_t size; } arrays[] = {
        {&it->parameters, n->n_parameters}, {&it->inputs, n->n_inputs}, {&it->state, n->n_state}, {&it->next, n->n_state},
        {&it->outputs, n->n_outputs}, {&it->constants, n->n_constants}, {&it->spare, n->n_constants}, {&it->built, n->n_parameters}};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) {
        *arrays[i].place = calloc((size_t)arrays[i].size + 1, sizeof(double));
        if (!*arrays[i].place) return refuse(it, "no memory for an instance");
    }
    copy(it->constants, it->unit.constants, n->n_constants);
    copy(it->built, it->unit.parameters, n->n_parameters);
    reset(it);
    it->last_handle = (uintptr_t)it << 16; /* states of two instances have different handles */
    return OK;
}

FMI const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI const char *fmi2GetVersion(void) { return "2.0"; }

FMI void fmi2FreeInstance(void *c) {
    Instance *it = c;
    if (!it) return;
    double *arrays[] = {it->parameters, it->inputs, it->state, it->next, it->outputs, it->constants, it->spare, it->built};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
    for (State *next, *state = it->states; state; state = next) {
        next = state->next;
        free(state);
    }
    free(it->unit.bytes);
    free(it->name);
    free(it);
}

static int instantiate(Instance *it, int type, const char *guid, const char *location) {
    if (type != 1) return refuse(it, "only co-simulation is offered");
    if (!location) return refuse(it, "no resource location was given");
    if (load_unit(it, location)) return ERROR;
    const char *own = text_at(&it->unit, it->unit.n.guid);
    if (strcmp(guid, own)) return refuse(it, "GUID = %s: must be %s, as in modelDescription.xml", guid, own);
    return allocate(it);
}

FMI void *fmi2Instantiate(const char *name, int type, const char *guid, const char *location, const Callbacks *callbacks, int visible, int logging) {
    (void)visible;
    Instance *it = calloc(1, sizeof *it);
    const char *known = name ? name : "";
    if (!it) return NULL;
    it->logging = logging;
    if (callbacks) it->logger = callbacks->logger, it->environment = callbacks->environment;
    it->name = malloc(strlen(known) + 1);
    if (it->name) strcpy(it->name, known);
    if (it->name && !instantiate(it, type, guid ? guid : "", location)) return it;
    fmi2FreeInstance(it);
    return NULL;
}

FMI int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const categories[]) {
    Instance *it = c;
    (void)n, (void)categories;
    if (!it) return ERROR;
    it->logging = on;
    return OK;
}

static int expect(Instance *it, int phase, const char *call) {
    return it->phase == phase ? OK : refuse(it, "%s: the FMU is %s", call, PHASES[it->phase]);
}

FMI int fmi2SetupExperiment(void *c, int tolerant, double tolerance, double from, int limited, double to) {
    Instance *it = c;
    (void)tolerant, (void)tolerance;
    if (!it || expect(it, NEW, "set-up of the experiment")) return ERROR;
    if (!isfinite(from)) return refuse(it, "start time = %s: must be finite", SHORTEST(from));
    if (limited && !(to >= from)) return refuse(it, "stop time = %s: must be >= the start time, %s s", SHORTEST(to), SHORTEST(from));
    it->time = from;
    it->stop = limited ? to : INFINITY;
    return OK;
}

FMI int fmi2EnterInitializationMode(void *c) {
    Instance *it = c;
    if (!it || expect(it, NEW, "initialisation mode")) return ERROR;
    it->phase = INITIALISING;
    return OK;
}

FMI int fmi2ExitInitializationMode(void *c) {
    Instance *it = c;
    if (!it || expect(it, INITIALISING, "end of initialisation mode")) return ERROR;
    int status = make_ready(it);
    it->phase = status == OK ? INITIALISED : NEW; /* for another try with better parameters */
    tell(it);
    return status;
}

FMI int fmi2Terminate(void *c) {
    Instance *it = c;
    if (!it || expect(it, INITIALISED, "terminate")) return ERROR;
    it->phase = TERMINATED;
    return OK;
}

FMI int fmi2Reset(void *c) {
    if (!c) return ERROR;
    reset(c);
    return OK;
}

static int check_step(Instance *it, double time, double step) {
    char shown[40];
    print_number(shown, sizeof shown, "%.9g", time);
    if (it->phase != INITIALISED) return report(it, DISCARD, "step at %s s: the FMU is %s", shown, PHASES[it->phase]);
    if (!isfinite(time) || !isfinite(step) || step <= 0)
        return refuse(it, "step of %s s at %s s: must be finite, and the step > 0 s", SHORTEST(step), SHORTEST(time));
    double tolerance = fmax(TIME_TOLERANCE * step, TIME_ROUNDING * fabs(time));
    if (fabs(time - it->time) > tolerance) return report(it, DISCARD, "time = %s: the FMU stands at %s s", SHORTEST(time), SHORTEST(it->time));
    if (time + step > it->stop + tolerance) return refuse(it, "step to %s s: the stop time is %s s", SHORTEST(time + step), SHORTEST(it->stop));
    return check_inputs(it, DISCARD);
}

FMI int fmi2DoStep(void *c, double time, double step, int final) {
    Instance *it = c;
    (void)final;
    if (!it) return ERROR;
    int status = check_step(it, time, step);
    if (status) return status;
    it->notes[0] = 0;
    int64_t answer = unit_step(it->constants, it->inputs, time, step, it->state, it->next, it->notes);
    if (answer) return tell_refusal(it, answer == DISCARD ? DISCARD : ERROR, "step: the unit refuses it");
    swap(&it->state, &it->next);
    it->fresh = 0;
    it->time = time + step;
    tell(it);
    return OK;
}

/* variables */

/* The variable of a value reference, NULL with a message where there is none of that kind. A count is given as a real number too. */
static const Variable *variable(Instance *it, Reference reference, int kind) {
    const Unit *unit = &it->unit;
    const Variable *v = unit->variables + reference;
    if (reference >= unit->n.n_variables) {
        refuse(it, "value reference = %u: must be below %lld", reference, (long long)unit->n.n_variables);
        return NULL;
    }
    if (v->kind == kind || (kind == REAL && v->flags & COUNT)) return v;
    refuse(it, "%s: asked for as %s, is %s", text_at(unit, v->name), KINDS[kind], v->items ? "Enumeration" : KINDS[v->kind]);
    return NULL;
}

static int check_request(Instance *it, const char *call, int kind, const Reference references[], size_t n, const void *values) {
    if (n && (!references || !values)) return refuse(it, "%s: no array was given", call);
    for (size_t i = 0; i < n; i++)
        if (!variable(it, references[i], kind)) return ERROR;
    return OK;
}

/* Where the value of a number stands; NULL with a message where it is not defined. */
static const double *place_of(Instance *it, const Variable *v) {
    if (v->causality == INPUT) return it->inputs + v->index;
    if (v->causality == PARAMETER) return it->parameters + v->index;
    if (!it->ready && make_ready(it)) return NULL;
    if (!(it->fresh >> v->group & 1)) {
        unit_outputs(it->constants, it->state, v->group, it->outputs);
        it->fresh |= (uint64_t)1 << v->group;
    }
    return it->outputs + v->index;
}

FMI int fmi2GetReal(void *c, const Reference references[], size_t n, double values[]) {
    Instance *it = c;
    if (!it || check_request(it, "get", REAL, references, n, values)) return ERROR;
    for (size_t i = 0; i < n; i++) {
        const double *place = place_of(it, it->unit.variables + references[i]);
        if (!place) return ERROR;
        values[i] = *place;
    }
    return OK;
}

static int get_integers(Instance *it, int kind, const Reference references[], size_t n, int values[]) {
    if (!it || check_request(it, "get", kind, references, n, values)) return ERROR;
    for (size_t i = 0; i < n; i++) {
        const Variable *v = it->unit.variables + references[i];
        const double *place = place_of(it, v);
        if (!place) return ERROR;
        if (!(fabs(*place) <= INT32_MAX)) return refuse(it, "%s = %s: is no integer", text_at(&it->unit, v->name), SHORTEST(*place));
        values[i] = kind == BOOLEAN ? *place != 0 : (int)*place;
    }
    return OK;
}

FMI int fmi2GetInteger(void *c, const Reference r[], size_t n, int values[]) { return get_integers(c, INTEGER, r, n, values); }
FMI int fmi2GetBoolean(void *c, const Reference r[], size_t n, int values[]) { return get_integers(c, BOOLEAN, r, n, values); }

FMI int fmi2GetString(void *c, const Reference references[], size_t n, const char *values[]) {
    Instance *it = c;
    if (!it || check_request(it, "get", STRING, references, n, values)) return ERROR;
    for (size_t i = 0; i < n; i++) values[i] = text_at(&it->unit, it->unit.variables[references[i]].index);
    return OK;
}

typedef struct { /* a value that the host sets */
    int kind;
    double number;
    const char *text;
} Value;

static Value value_at(int kind, const void *values, size_t i) {
    Value value = {kind, 0, ""};
    if (kind == REAL) value.number = ((const double *)values)[i];
    else if (kind == INTEGER) value.number = ((const int *)values)[i];
    else if (kind == BOOLEAN) value.number = ((const int *)values)[i] != 0;
    else if (((const char *const *)values)[i]) value.text = ((const char *const *)values)[i];
    return value;
}

static const char *shown(char text[100], Value value) {
    if (value.kind == REAL) return print_shortest(text, value.number);
    if (value.kind == INTEGER) snprintf(text, 100, "%.0f", value.number);
    else if (value.kind == BOOLEAN) snprintf(text, 100, value.number != 0 ? "True" : "False");
    else snprintf(text, 100, strlen(value.text) > 80 ? "'%.77s...'" : "'%s'", value.text);
    return text;
}

/* Why `value` cannot be that of the parameter `v`, NULL if it can; ranges are checked when the unit is made. */
static const char *objection_to_parameter(const Unit *unit, const Variable *v, Value value) {
    static const char fixed[] = "is fixed at export; export the FMU anew with it";
    if (v->kind == STRING) return strcmp(value.text, text_at(unit, v->index)) ? fixed : NULL;
    if (v->items && !(value.number >= 1 && value.number <= (double)v->items && value.number == floor(value.number))) return text_at(unit, v->rule);
    if (!isfinite(value.number)) return "must be finite";
    return v->flags & FIXED && value.number != unit->parameters[v->index] ? fixed : NULL;
}

static const char *objection(const Instance *it, const Variable *v, Value value) {
    if (v->causality == OUTPUT) return "an output cannot be set";
    if (it->phase == TERMINATED) return "the FMU is terminated";
    if (v->causality == INPUT) return NULL;
    if (it->phase == INITIALISED) return "a parameter cannot be set after initialisation";
    return objection_to_parameter(&it->unit, v, value);
}

/* All of them or, where one is refused, none. */
static int set(Instance *it, int kind, const Reference references[], size_t n, const void *values) {
    if (!it) return ERROR;
    if (n && (!references || !values)) return refuse(it, "set: no array was given");
    for (size_t i = 0; i < n; i++) {
        const Variable *v = variable(it, references[i], kind);
        const char *reason = v ? objection(it, v, value_at(kind, values, i)) : NULL;
        if (!v) return ERROR;
        if (reason) return refuse(it, "%s = %s: %s", text_at(&it->unit, v->name), shown((char[100]){0}, value_at(kind, values, i)), reason);
    }
    for (size_t i = 0; i < n && kind != STRING; i++) {
        const Variable *v = it->unit.variables + references[i];
        (v->causality == INPUT ? it->inputs : it->parameters)[v->index] = value_at(kind, values, i).number;
    }
    if (it->phase != INITIALISED && it->phase != TERMINATED) it->ready = 0;
    return OK;
}

FMI int fmi2SetReal(void *c, const Reference r[], size_t n, const double values[]) { return set(c, REAL, r, n, values); }
FMI int fmi2SetInteger(void *c, const Reference r[], size_t n, const int values[]) { return set(c, INTEGER, r, n, values); }
FMI int fmi2SetBoolean(void *c, const Reference r[], size_t n, const int values[]) { return set(c, BOOLEAN, r, n, values); }
FMI int fmi2SetString(void *c, const Reference r[], size_t n, const char *const values[]) { return set(c, STRING, r, n, values); }

/* states: the host holds a number, never an address, so that a wrong one is found out, not followed */

typedef struct { /* head of a state's bytes; the checksum is of all that follows it */
    char magic[24];
    uint64_t checksum;
    char guid[64];
    int64_t n_parameters, n_inputs, n_state, phase, ready;
    double time;
} Head;
static const char STATE_MAGIC[24] = "pipelay native state 1\n";
enum { UNCHECKED = 32 };

static int64_t state_numbers(const Instance *it) { return it->unit.n.n_parameters + it->unit.n.n_inputs + it->unit.n.n_state; }

static State *find_state(const Instance *it, void *handle) {
    State *state = it->states;
    while (state && state->handle != (uintptr_t)handle) state = state->next;
    return state;
}

static State *known_state(Instance *it, void *handle) {
    State *state = find_state(it, handle);
    if (!state) refuse(it, "state: unknown, or freed before");
    return state;
}

/* The state of that handle, or else a new one, whose handle is put there. */
static State *place_for_state(Instance *it, void **handle) {
    State *state = find_state(it, *handle);
    if (state) return state;
    state = malloc(sizeof *state + (size_t)state_numbers(it) * sizeof(double));
    if (!state) {
        refuse(it, "state: no memory for it");
        return NULL;
    }
    state->next = it->states;
    state->handle = ++it->last_handle;
    it->states = state;
    *handle = (void *)state->handle;
    return state;
}

FMI int fmi2GetFMUstate(void *c, void **handle) {
    Instance *it = c;
    if (!it) return ERROR;
    if (!handle) return refuse(it, "state: no place was given");
    State *state = place_for_state(it, handle);
    if (!state) return ERROR;
    const Sizes *n = &it->unit.n;
    double *unit_state = state->values + n->n_parameters + n->n_inputs;
    state->phase = it->phase;
    state->ready = it->ready;
    state->time = it->time;
    copy(state->values, it->parameters, n->n_parameters);
    copy(state->values + n->n_parameters, it->inputs, n->n_inputs);
    if (it->ready) copy(unit_state, it->state, n->n_state);
    else memset(unit_state, 0, (size_t)n->n_state * sizeof *unit_state);
    return OK;
}

FMI int fmi2SetFMUstate(void *c, void *handle) {
    Instance *it = c;
    State *state = it ? known_state(it, handle) : NULL;
    if (!state || (state->ready && build_constants(it, state->values))) return ERROR;
    const Sizes *n = &it->unit.n;
    it->phase = (int)state->phase;
    it->ready = (int)state->ready;
    it->time = state->time;
    it->fresh = 0;
    it->notes[0] = 0;
    copy(it->parameters, state->values, n->n_parameters);
    copy(it->inputs, state->values + n->n_parameters, n->n_inputs);
    copy(it->state, state->values + n->n_parameters + n->n_inputs, n->n_state);
    return OK;
}

FMI int fmi2FreeFMUstate(void *c, void **handle) {
    Instance *it = c;
    if (!it) return ERROR;
    if (!handle || !*handle) return OK;
    State *state = known_state(it, *handle), **place = &it->states;
    *handle = NULL;
    if (!state) return ERROR;
    while (*place != state) place = &(*place)->next;
    *place = state->next;
    free(state);
    return OK;
}

static size_t bytes_of_state(const Instance *it) { return sizeof(Head) + (size_t)state_numbers(it) * sizeof(double); }

FMI int fmi2SerializedFMUstateSize(void *c, void *handle, size_t *size) {
    Instance *it = c;
    if (!it) return ERROR;
    if (!size) return refuse(it, "state: no place for its size was given");
    if (!known_state(it, handle)) return ERROR;
    *size = bytes_of_state(it);
    return OK;
}

FMI int fmi2SerializeFMUstate(void *c, void *handle, char bytes[], size_t size) {
    Instance *it = c;
    if (!it) return ERROR;
    if (!bytes) return refuse(it, "state: no place for its bytes was given");
    State *state = known_state(it, handle);
    if (!state) return ERROR;
    if (size != bytes_of_state(it)) return refuse(it, "state: has %zu bytes, not %zu", bytes_of_state(it), size);
    const Sizes *n = &it->unit.n;
    Head head = {.n_parameters = n->n_parameters, .n_inputs = n->n_inputs, .n_state = n->n_state};
    memcpy(head.magic, STATE_MAGIC, sizeof head.magic);
    snprintf(head.guid, sizeof head.guid, "%s", text_at(&it->unit, n->guid));
    head.phase = state->phase, head.ready = state->ready, head.time = state->time;
    memcpy(bytes, &head, sizeof head);
    memcpy(bytes + sizeof head, state->values, size - sizeof head);
    head.checksum = checksum(bytes + UNCHECKED, size - UNCHECKED);
    memcpy(bytes, &head, UNCHECKED);
    return OK;
}

/* Refuses bytes that are not those of a state of this FMU. */
static int check_head(Instance *it, const Head *head) {
    const Sizes *n = &it->unit.n;
    if (!isfinite(head->time) || !within(head->phase, 4) || !within(head->ready, 2))
        return refuse(it, "state: cannot be read back: its time is %s s, its phase %lld", SHORTEST(head->time), (long long)head->phase);
    char guid[sizeof head->guid];
    snprintf(guid, sizeof guid, "%s", text_at(&it->unit, n->guid));
    if (strncmp(head->guid, guid, sizeof guid)) return refuse(it, "state: of another FMU, with the GUID %.63s", head->guid);
    if (head->ready ? head->phase == NEW : head->phase > INITIALISING)
        return refuse(it, "state: cannot be read back: it is %s, %s the state of a unit", PHASES[head->phase], head->ready ? "with" : "without");
    if (head->n_parameters != n->n_parameters || head->n_inputs != n->n_inputs || head->n_state != n->n_state)
        return refuse(it, "state: of another layout: %lld parameters, %lld inputs, %lld values, must be %lld, %lld, %lld",
                      (long long)head->n_parameters, (long long)head->n_inputs, (long long)head->n_state,
                      (long long)n->n_parameters, (long long)n->n_inputs, (long long)n->n_state);
    return OK;
}

/* Refuses parameters that no host could have set. */
static int check_parameters(Instance *it, const char *doubles) {
    const Unit *unit = &it->unit;
    for (const Variable *v = unit->variables; v < unit->variables + unit->n.n_variables; v++) {
        if (v->causality != PARAMETER || v->kind == STRING) continue;
        Value value = {REAL, 0, ""};
        memcpy(&value.number, doubles + v->index * (int64_t)sizeof(double), sizeof value.number);
        const char *reason = equal(&value.number, unit->parameters + v->index, 1) ? NULL : objection_to_parameter(unit, v, value);
        if (reason) return refuse(it, "%s = %s: %s", text_at(unit, v->name), shown((char[100]){0}, value), reason);
    }
    return OK;
}

FMI int fmi2DeSerializeFMUstate(void *c, const char bytes[], size_t size, void **handle) {
    Instance *it = c;
    Head head;
    if (!it) return ERROR;
    if (!handle || (size && !bytes)) return refuse(it, "state: no place was given");
    *handle = NULL;
    if (size >= sizeof head) memcpy(&head, bytes, sizeof head);
    if (size < sizeof head || memcmp(head.magic, STATE_MAGIC, sizeof head.magic) || head.checksum != checksum(bytes + UNCHECKED, size - UNCHECKED))
        return refuse(it, "state: cannot be read back: these %zu bytes are not those of a state, or not all of them", size);
    if (check_head(it, &head)) return ERROR;
    if (size != bytes_of_state(it)) return refuse(it, "state: of another layout: %zu bytes, must be %zu", size, bytes_of_state(it));
    if (check_parameters(it, bytes + sizeof head)) return ERROR;
    State *state = place_for_state(it, handle);
    if (!state) return ERROR;
    state->phase = head.phase;
    state->ready = head.ready;
    state->time = head.time;
    memcpy(state->values, bytes + sizeof head, size - sizeof head);
    return OK;
}

/* the rest of FMI 2.0 */

FMI int fmi2GetRealStatus(void *c, int kind, double *value) {
    Instance *it = c;
    if (!it) return ERROR;
    if (kind != 2 || !value) return DISCARD; /* 2: fmi2LastSuccessfulTime */
    *value = it->time;
    return OK;
}
FMI int fmi2GetBooleanStatus(void *c, int kind, int *value) {
    if (!c) return ERROR;
    if (kind != 3 || !value) return DISCARD; /* 3: fmi2Terminated */
    *value = 0;
    return OK;
}
FMI int fmi2GetStatus(void *c, int kind, int *value) { (void)kind, (void)value; return c ? DISCARD : ERROR; }
FMI int fmi2GetIntegerStatus(void *c, int kind, int *value) { (void)kind, (void)value; return c ? DISCARD : ERROR; }
FMI int fmi2GetStringStatus(void *c, int kind, const char **value) { (void)kind, (void)value; return c ? DISCARD : ERROR; }

static int missing(void *c, const char *what) { return c ? refuse((Instance *)c, "%s: not offered", what) : ERROR; }

FMI int fmi2GetDirectionalDerivative(void *c, const Reference u[], size_t nu, const Reference k[], size_t nk, const double dk[], double du[]) {
    (void)u, (void)nu, (void)k, (void)nk, (void)dk, (void)du;
    return missing(c, "directional derivatives");
}
FMI int fmi2SetRealInputDerivatives(void *c, const Reference r[], size_t n, const int order[], const double v[]) {
    (void)r, (void)n, (void)order, (void)v;
    return missing(c, "input derivatives");
}
FMI int fmi2GetRealOutputDerivatives(void *c, const Reference r[], size_t n, const int order[], double v[]) {
    (void)r, (void)n, (void)order, (void)v;
    return missing(c, "output derivatives");
}
FMI int fmi2CancelStep(void *c) { return missing(c, "cancelling a step"); }

/* of model exchange, since some hosts look for all symbols */
FMI int fmi2EnterEventMode(void *c) { return missing(c, "model exchange"); }
FMI int fmi2NewDiscreteStates(void *c, void *info) { (void)info; return missing(c, "model exchange"); }
FMI int fmi2EnterContinuousTimeMode(void *c) { return missing(c, "model exchange"); }
FMI int fmi2CompletedIntegratorStep(void *c, int final, int *event, int *end) { (void)final, (void)event, (void)end; return missing(c, "model exchange"); }
FMI int fmi2SetTime(void *c, double time) { (void)time; return missing(c, "model exchange"); }
FMI int fmi2SetContinuousStates(void *c, const double x[], size_t n) { (void)x, (void)n; return missing(c, "model exchange"); }
FMI int fmi2GetDerivatives(void *c, double x[], size_t n) { (void)x, (void)n; return missing(c, "model exchange"); }
FMI int fmi2GetEventIndicators(void *c, double x[], size_t n) { (void)x, (void)n; return missing(c, "model exchange"); }
FMI int fmi2GetContinuousStates(void *c, double x[], size_t n) { (void)x, (void)n; return missing(c, "model exchange"); }
FMI int fmi2GetNominalsOfContinuousStates(void *c, double x[], size_t n) { (void)x, (void)n; return missing(c, "model exchange"); }
