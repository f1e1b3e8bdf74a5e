/* FMI 2.0 co-simulation face of a unit in machine code: needs the C library alone.

   It holds the rules of FMI (phases, value references, states, messages); the physics are the four unit_ functions that it is linked with, the
   data are those of resources/unit.bin (see tables.py), read once when an instance is made. It starts no thread and no process, changes no
   global, and allocates memory for new instances and new states only. All numbers of a unit are doubles. */
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <wchar.h>
#define FMI __declspec(dllexport)
#define UTF8 65001 /* windows.h defines half of our names */
__declspec(dllimport) int __stdcall MultiByteToWideChar(unsigned page, unsigned long flags, const char *text, int size, wchar_t *wide, int room);
enum { WINDOWS = 1 };
#else
#define FMI __attribute__((visibility("default")))
enum { WINDOWS = 0 };
#endif

/* The unit. A note is a line for the log: status, number of a message, count of its values, values; before all of them stands their number. */
extern int64_t unit_constants(const double *exported, const double *parameters, double *constants, double *notes);
extern int64_t unit_start(const double *constants, const double *exported, const double *exported_state, const double *inputs, double time,
                          double *state, double *notes);
extern int64_t unit_step(const double *constants, const double *inputs, double time, double h, const double *state, double *next, double *notes);
extern void unit_outputs(const double *constants, const double *state, int64_t group, double *outputs);

enum { N_NOTES = 256, LONGEST_LINE = 1000, LONGEST_TEXT = 4096, MOST_GROUPS = 64, HEADER = 104 };
enum { OK, WARNING, DISCARD, ERROR };
enum { INPUT, OUTPUT, PARAMETER };
enum { REAL, INTEGER, BOOLEAN, STRING };
enum { ABOVE_MINIMUM = 1, BELOW_MAXIMUM = 2, FIXED = 4, COUNT = 8 };
enum { NEW, INITIALISING, INITIALISED, TERMINATED };
static const char *const PHASES[] = {"not initialised", "initialising", "initialised", "terminated"};
static const char *const KINDS[] = {"Real", "Integer", "Boolean", "String"};
static const double TIME_TOLERANCE = 1e-6; /* of a step: hosts add up their time in ways of their own */
static const double TIME_ROUNDING = 1e-12; /* of the time, however short the step */

typedef unsigned Reference;
typedef void (*Logger)(void *environment, const char *name, int status, const char *category, const char *message, ...);
typedef struct {
    Logger logger;
    void *allocate, *release, *step_finished;
    void *environment;
} Callbacks;

typedef struct {
    int64_t causality, kind, index, group, name, rule, flags, items;
    double minimum, maximum;
    int64_t reserved[2];
} Variable;

typedef struct { /* head of unit.bin, without the first 16 bytes */
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

/* messages */

/* `value` by a printf directive of doubles, with a dot in every locale. */
static void print_number(char *text, size_t room, const char *directive, double value) {
    if (isnan(value)) snprintf(text, room, "nan");
    else if (isinf(value)) snprintf(text, room, value < 0 ? "-inf" : "inf");
    else snprintf(text, room, directive, value);
    for (; *text; text++)
        if (*text == ',') *text = '.';
}

/* The shortest decimal number that is `value`, as Python writes it. */
static const char *print_shortest(char text[40], double value) {
    static const char *const directives[] = {"%.15g", "%.16g", "%.17g"};
    if (!isfinite(value)) print_number(text, 40, "%g", value);
    for (int i = 0; isfinite(value) && i < 3; i++) {
        snprintf(text, 37, directives[i], value);
        if (strtod(text, NULL) == value) break;
    }
    for (char *at = text; *at; at++)
        if (*at == ',') *at = '.';
    if (!strpbrk(text, ".en")) strcat(text, ".0");
    return text;
}
#define SHORTEST(value) print_shortest((char[40]){0}, value)

/* Bytes of the character of UTF-8 at `in`, 0 where it is none. */
static int length_of(const char *in) {
    unsigned char first = (unsigned char)*in;
    int length = first < 0x80 ? 1 : first < 0xC2 ? 0 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : first < 0xF5 ? 4 : 0;
    for (int i = 1; i < length; i++)
        if (((unsigned char)in[i] & 0xC0) != 0x80) return 0;
    return length;
}

/* One line of at most LONGEST_LINE characters, fit for a printf format. */
static void printable(const char *in, char *out) {
    int characters = 0;
    const char *start = out;
    while (*in && characters < LONGEST_LINE) {
        size_t blank = strspn(in, " \t\n\v\f\r");
        in += blank;
        if (!*in) break;
        if (blank && out != start) {
            *out++ = ' ';
            if (++characters == LONGEST_LINE) break;
        }
        int length = length_of(in);
        if (length == 0 || (unsigned char)*in < ' ' || *in == 0x7F) *out++ = '?', in++;
        else {
            if (*in == '%') *out++ = '%';
            while (length--) *out++ = *in++;
        }
        characters++;
    }
    *out = 0;
}

static void say(Instance *it, int status, const char *message) {
    static const char *const categories[] = {"logStatusOK", "logStatusWarning", "logStatusDiscard", "logStatusError"};
    char line[4 * LONGEST_LINE + 1];
    if (!it->logger || (status == OK && !it->logging)) return;
    printable(message, line);
    it->logger(it->environment, it->name, status, categories[status], line);
}

static int report(Instance *it, int status, const char *format, ...) {
    char text[LONGEST_TEXT];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    say(it, status, text);
    return status;
}
#define refuse(it, ...) report(it, ERROR, __VA_ARGS__)

static const char *text_at(const Unit *unit, int64_t offset) { return unit->text + offset; }

/* Prints the next value by `directive`, whose last character is at `last`. */
static void print_value(const Unit *unit, char *out, size_t room, char *directive, char *last, double value) {
    if (*last == 's') {
        int known = value >= 0 && value < (double)unit->n.n_messages;
        snprintf(out, room, "%s", known ? text_at(unit, unit->messages[(int64_t)value]) : "?");
    } else if (*last != 'd') {
        print_number(out, room, directive, value);
    } else if (fabs(value) < 9e18) {
        strcpy(last, "lld");
        snprintf(out, room, directive, (long long)value);
    } else {
        print_number(out, room, "%.0f", value);
    }
}

/* A message with its values: %g, %e, %f, %d, %s, with flags, width and precision, and %%. */
static void explain(const Unit *unit, const char *template, const double *values, int64_t count, char *out, size_t room) {
    while (*template && room > 1) {
        size_t span = *template == '%' ? strspn(template + 1, "-+ #0123456789.") + 1 : 0;
        char directive[24], *last = directive + span;
        *out = 0;
        if (!span || template[1] == '%' || span > 16 || !template[span] || !strchr("gGeEfds", template[span])) {
            *out++ = *template;
            template += template[0] == '%' && template[1] == '%' ? 2 : 1;
            room--;
        } else {
            memcpy(directive, template, span + 1);
            last[1] = 0;
            print_value(unit, out, room, directive, last, count > 0 ? *values : NAN);
            if (count-- > 0) values++;
            room -= strlen(out);
            out += strlen(out);
            template += span + 1;
        }
    }
    *out = 0;
}

/* Logs the notes that the unit has left. */
static void tell(Instance *it) {
    const double *at = it->notes + 1, *end = it->notes + N_NOTES;
    char text[LONGEST_TEXT];
    for (double left = it->notes[0]; left > 0 && end - at >= 3; left--) {
        int known = at[1] >= 0 && at[1] < (double)it->unit.n.n_messages && at[2] >= 0 && at[2] <= (double)(end - at - 3);
        if (!known) break;
        int64_t count = (int64_t)at[2];
        explain(&it->unit, text_at(&it->unit, it->unit.messages[(int64_t)at[1]]), at + 3, count, text, sizeof text);
        say(it, at[0] == WARNING ? WARNING : at[0] == DISCARD ? DISCARD : ERROR, text);
        at += 3 + count;
    }
    it->notes[0] = 0;
}

/* What a unit that refuses says, or else `otherwise`. */
static int tell_refusal(Instance *it, int status, const char *otherwise) {
    if (!(it->notes[0] > 0)) return report(it, status, "%s", otherwise);
    tell(it);
    return status;
}

/* the unit */

static void swap(double **one, double **other) {
    double *kept = *one;
    *one = *other;
    *other = kept;
}

static void copy(double *to, const double *from, int64_t n) { memcpy(to, from, (size_t)n * sizeof *to); }

static int equal(const double *one, const double *other, int64_t n) { return !memcmp(one, other, (size_t)n * sizeof *one); }

static int check_ranges(Instance *it, const double *parameters) {
    const Unit *unit = &it->unit;
    for (const Variable *v = unit->variables; v < unit->variables + unit->n.n_variables; v++) {
        if (v->causality != PARAMETER || v->kind == STRING || v->items || v->flags & FIXED) continue;
        double value = parameters[v->index];
        int below = value < v->minimum || (v->flags & ABOVE_MINIMUM && value == v->minimum);
        int above = value > v->maximum || (v->flags & BELOW_MAXIMUM && value == v->maximum);
        if (!below && !above) continue;
        char shown[40];
        print_number(shown, sizeof shown, "%g", value);
        return refuse(it, "%s = %s: %s", text_at(unit, v->name), shown, text_at(unit, v->rule));
    }
    return OK;
}

/* Makes `constants` those of `parameters`; they stay what they are where the parameters are refused. */
static int build_constants(Instance *it, const double *parameters) {
    const Unit *unit = &it->unit;
    if (equal(parameters, it->built, unit->n.n_parameters)) return OK;
    copy(it->spare, unit->constants, unit->n.n_constants);
    if (!equal(parameters, unit->parameters, unit->n.n_parameters)) {
        if (check_ranges(it, parameters)) return ERROR;
        it->notes[0] = 0;
        if (unit_constants(unit->constants, parameters, it->spare, it->notes)) return tell_refusal(it, ERROR, "parameters: the unit refuses them");
    }
    swap(&it->constants, &it->spare);
    copy(it->built, parameters, unit->n.n_parameters);
    it->fresh = 0;
    return OK;
}

/* OK, or `status` with the name of an input that is not finite. */
static int check_inputs(Instance *it, int status) {
    const Unit *unit = &it->unit;
    double sum = 0;
    for (int64_t i = 0; i < unit->n.n_inputs; i++) sum += it->inputs[i] * 0; /* nan where one is not finite */
    if (sum == 0) return OK;
    for (const Variable *v = unit->variables; v < unit->variables + unit->n.n_variables; v++)
        if (v->causality == INPUT && !isfinite(it->inputs[v->index]))
            return report(it, status, "%s = %s: must be finite", text_at(unit, v->name), SHORTEST(it->inputs[v->index]));
    return OK;
}

/* Initialises the unit unless it is, with what is set. Its warnings stay in `notes`. */
static int make_ready(Instance *it) {
    const Unit *unit = &it->unit;
    if (it->ready) return OK;
    if (it->phase == NEW) return refuse(it, "outputs: not defined before initialisation");
    if (build_constants(it, it->parameters) || check_inputs(it, ERROR)) return ERROR;
    it->notes[0] = 0;
    if (unit_start(it->constants, unit->constants, unit->state, it->inputs, it->time, it->state, it->notes))
        return tell_refusal(it, ERROR, "initialisation: the unit refuses it");
    it->fresh = 0;
    it->ready = 1;
    return OK;
}

/* unit.bin */

static FILE *open_file(const char *path) {
#ifdef _WIN32
    int size = MultiByteToWideChar(UTF8, 0, path, -1, NULL, 0);
    wchar_t *wide = size > 0 ? malloc((size_t)size * sizeof *wide) : NULL;
    FILE *file = wide && MultiByteToWideChar(UTF8, 0, path, -1, wide, size) ? _wfopen(wide, L"rb") : NULL;
    free(wide);
    return file;
#else
    return fopen(path, "rb");
#endif
}

static int letter(char c) { return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z'); }

static int hexadecimal(char c) { return c >= '0' && c <= '9' ? c - '0' : c >= 'A' && c <= 'F' ? c - 'A' + 10 : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1; }

/* The path of a resource location: "file:///a%20b" gives "/a b", on Windows "file:///C:/x" gives "C:/x" and "file://host/x" "//host/x". */
static void decode(const char *location, char *path) {
    const char *in = location;
    int encoded = !strncmp(in, "file:", 5);
    if (encoded) {
        in += 5;
        if (!strncmp(in, "//", 2)) {
            const char *root = strchr(in + 2, '/');
            int local = in[2] == '/' || !strncmp(in + 2, "localhost/", 10);
            if (WINDOWS && letter(in[2]) && in[3] == ':') in += 2;
            else if (root && (local || !WINDOWS)) in = root;
        }
        if (WINDOWS && in[0] == '/' && letter(in[1]) && in[2] == ':') in++;
    }
    char *out = path;
    while (*in) {
        int high = encoded && *in == '%' ? hexadecimal(in[1]) : -1, low = high >= 0 ? hexadecimal(in[2]) : -1;
        if (low >= 0 && high + low > 0) *out++ = (char)(16 * high + low), in += 3;
        else *out++ = *in++;
    }
    while (out > path + 1 && (out[-1] == '/' || (WINDOWS && out[-1] == '\\'))) out--;
    *out = 0;
}

/* Reads the whole file, its size into `size`; NULL with a message where it cannot be read. */
static char *read_file(Instance *it, const char *path, size_t *size) {
    FILE *file = open_file(path);
    if (!file) {
        refuse(it, "resources: %s: %s", path, strerror(errno));
        return NULL;
    }
    long end = fseek(file, 0, SEEK_END) ? -1 : ftell(file);
    char *bytes = end > 0 ? malloc((size_t)end) : NULL;
    rewind(file);
    if (bytes && fread(bytes, 1, (size_t)end, file) == (size_t)end) {
        *size = (size_t)end;
    } else {
        refuse(it, "resources: %s: cannot be read", path);
        free(bytes);
        bytes = NULL;
    }
    fclose(file);
    return bytes;
}

static int within(int64_t index, int64_t n) { return index >= 0 && index < n; }

/* Whether all that the tables point to is there. */
static int sound(const Unit *unit) {
    const Sizes *n = &unit->n;
    if (unit->text[n->n_text - 1] || !within(n->guid, n->n_text) || !within(n->name, n->n_text)) return 0;
    for (int64_t i = 0; i < n->n_messages; i++)
        if (!within(unit->messages[i], n->n_text)) return 0;
    for (const Variable *v = unit->variables; v < unit->variables + n->n_variables; v++) {
        int64_t places[] = {n->n_inputs, n->n_outputs, v->kind == STRING ? n->n_text : n->n_parameters};
        if (!within(v->causality, 3) || !within(v->kind, 4) || !within(v->name, n->n_text) || !within(v->rule, n->n_text)) return 0;
        if (!within(v->index, places[v->causality]) || (v->kind == STRING && v->causality != PARAMETER)) return 0;
        if (v->causality == OUTPUT && !within(v->group, n->n_groups)) return 0;
    }
    return 1;
}

/* Lays `unit` over the bytes of unit.bin. */
static int open_unit(Unit *unit, char *bytes, size_t size) {
    unit->bytes = bytes;
    if (size < HEADER || memcmp(bytes, "pipelay unit 1\n", 16)) return 0;
    memcpy(&unit->n, bytes + 16, sizeof unit->n);
    const Sizes *n = &unit->n;
    for (const int64_t *each = &n->n_constants; each <= &n->n_text; each++)
        if (!within(*each, INT32_MAX)) return 0;
    int64_t doubles = n->n_constants + n->n_state + n->n_inputs + n->n_parameters;
    if (n->n_text < 1 || n->n_groups > MOST_GROUPS) return 0;
    if ((int64_t)size != HEADER + 8 * (doubles + 12 * n->n_variables + n->n_messages) + n->n_text) return 0;
    unit->constants = (const double *)(bytes + HEADER);
    unit->state = unit->constants + n->n_constants;
    unit->inputs = unit->state + n->n_state;
    unit->parameters = unit->inputs + n->n_inputs;
    unit->variables = (const Variable *)(unit->parameters + n->n_parameters);
    unit->messages = (const int64_t *)(unit->variables + n->n_variables);
    unit->text = (const char *)(unit->messages + n->n_messages);
    return sound(unit);
}

static int load_unit(Instance *it, const char *location) {
    size_t size = 0;
    char *path = malloc(strlen(location) + sizeof "/unit.bin");
    if (!path) return ERROR;
    decode(location, path);
    strcat(path, "/unit.bin");
    char *bytes = read_file(it, path, &size);
    int status = bytes ? OK : ERROR;
    if (bytes && !open_unit(&it->unit, bytes, size)) status = refuse(it, "resources: %s: not the data of a unit, or not all of them", path);
    free(path);
    return status;
}

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

static uint64_t checksum(const char *bytes, size_t size) { /* FNV-1a */
    uint64_t sum = 0xcbf29ce484222325u;
    for (size_t i = 0; i < size; i++) sum = (sum ^ (unsigned char)bytes[i]) * 0x100000001b3u;
    return sum;
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
