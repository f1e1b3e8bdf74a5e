/* A unit and its data: the four functions that it is made of, its notes to the log, resources/unit.bin (see tables.py). */
#include "face.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#ifdef _WIN32
#include <wchar.h>
#define UTF8 65001 /* windows.h defines half of our names */
__declspec(dllimport) int __stdcall MultiByteToWideChar(unsigned page, unsigned long flags, const char *text, int size, wchar_t *wide, int room);
enum { WINDOWS = 1 };
#else
enum { WINDOWS = 0 };
#endif

enum { LONGEST_LINE = 1000, LONGEST_TEXT = 4096, MOST_GROUPS = 64 };

/* messages */

void print_number(char *text, size_t room, const char *directive, double value) {
    if (isnan(value)) snprintf(text, room, "nan");
    else if (isinf(value)) snprintf(text, room, value < 0 ? "-inf" : "inf");
    else snprintf(text, room, directive, value);
    for (; *text; text++)
        if (*text == ',') *text = '.';
}

const char *print_shortest(char text[40], double value) {
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

int report(Instance *it, int status, const char *format, ...) {
    char text[LONGEST_TEXT];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    say(it, status, text);
    return status;
}
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

void tell(Instance *it) {
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

int tell_refusal(Instance *it, int status, const char *otherwise) {
    if (!(it->notes[0] > 0)) return report(it, status, "%s", otherwise);
    tell(it);
    return status;
}

/* the unit */

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

int build_constants(Instance *it, const double *parameters) {
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

int check_inputs(Instance *it, int status) {
    const Unit *unit = &it->unit;
    double sum = 0;
    for (int64_t i = 0; i < unit->n.n_inputs; i++) sum += it->inputs[i] * 0; /* nan where one is not finite */
    if (sum == 0) return OK;
    for (const Variable *v = unit->variables; v < unit->variables + unit->n.n_variables; v++)
        if (v->causality == INPUT && !isfinite(it->inputs[v->index]))
            return report(it, status, "%s = %s: must be finite", text_at(unit, v->name), SHORTEST(it->inputs[v->index]));
    return OK;
}

int make_ready(Instance *it) {
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

typedef struct {
    char magic[16];
    uint64_t kernels, checksum; /* of the library that it belongs to, see machine.py; of all that follows */
} Head;
enum { HEADER = sizeof(Head) + sizeof(Sizes) };

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

/* Lays `unit` over the bytes of unit.bin; answers what is wrong with them, NULL if nothing is. */
static const char *open_unit(Unit *unit, char *bytes, size_t size) {
    static const char foreign[] = "not the data of a unit, or not all of them";
    Head head;
    unit->bytes = bytes;
    if (size < HEADER) return foreign;
    memcpy(&head, bytes, sizeof head);
    if (memcmp(head.magic, "pipelay unit 1\n", sizeof head.magic)) return foreign;
    if (head.kernels != KERNELS) return "of another version or unit than the library; take both from one FMU";
    if (head.checksum != checksum(bytes + sizeof head, size - sizeof head)) return foreign;
    memcpy(&unit->n, bytes + sizeof head, sizeof unit->n);
    const Sizes *n = &unit->n;
    for (const int64_t *each = &n->n_constants; each <= &n->n_text; each++)
        if (!within(*each, INT32_MAX)) return foreign;
    int64_t doubles = n->n_constants + n->n_state + n->n_inputs + n->n_parameters;
    if (n->n_text < 1 || n->n_groups > MOST_GROUPS) return foreign;
    if ((int64_t)size != HEADER + 8 * (doubles + 12 * n->n_variables + n->n_messages) + n->n_text) return foreign;
    unit->constants = (const double *)(bytes + HEADER);
    unit->state = unit->constants + n->n_constants;
    unit->inputs = unit->state + n->n_state;
    unit->parameters = unit->inputs + n->n_inputs;
    unit->variables = (const Variable *)(unit->parameters + n->n_parameters);
    unit->messages = (const int64_t *)(unit->variables + n->n_variables);
    unit->text = (const char *)(unit->messages + n->n_messages);
    return sound(unit) ? NULL : foreign;
}

int load_unit(Instance *it, const char *location) {
    size_t size = 0;
    char *path = malloc(strlen(location) + sizeof "/unit.bin");
    if (!path) return ERROR;
    decode(location, path);
    strcat(path, "/unit.bin");
    char *bytes = read_file(it, path, &size);
    const char *wrong = bytes ? open_unit(&it->unit, bytes, size) : NULL;
    int status = bytes ? OK : ERROR;
    if (wrong) status = refuse(it, "resources: %s: %s", path, wrong);
    free(path);
    return status;
}
