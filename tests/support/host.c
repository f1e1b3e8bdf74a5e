/* The smallest host: host LIBRARY RESOURCES GUID STEP COUNT [VR=VALUE | VR]...
   Instantiates, initialises, sets the reals VR=VALUE, takes COUNT steps of STEP seconds, each twice from a saved state, prints the reals VR. */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST = 512 };
typedef struct { void *logger, *allocate, *release, *finished, *environment; } Callbacks;

static void note(void *environment, const char *name, int status, const char *category, const char *message, ...) {
    va_list arguments;
    (void)environment;
    va_start(arguments, message);
    fprintf(stderr, "%s [%d %s] ", name, status, category);
    vfprintf(stderr, message, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

static void *library;
static void *function(const char *name) {
    void *found = dlsym(library, name);
    if (!found) fprintf(stderr, "%s: %s\n", name, dlerror()), exit(3);
    return found;
}
#define CALL(name, types, ...) \
    do { int status = ((int (*)types)function(name))(__VA_ARGS__); if (status > 1) { fprintf(stderr, "%s: status %d\n", name, status); return 2; } } while (0)

int main(int count, char **words) {
    library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) return fprintf(stderr, "%s\n", dlerror()), 3;
    Callbacks callbacks = {(void *)note, (void *)calloc, (void *)free, NULL, NULL};
    void *it = ((void *(*)(const char *, int, const char *, const char *, const Callbacks *, int, int))function("fmi2Instantiate"))(
        "unit", 1, words[3], words[2], &callbacks, 0, 0);
    if (!it) return fprintf(stderr, "not instantiated\n"), 1;
    double step = atof(words[4]), time = 0.0, values[MOST];
    unsigned references[MOST], n = 0;
    CALL("fmi2SetupExperiment", (void *, int, double, double, int, double), it, 0, 0.0, 0.0, 0, 0.0);
    CALL("fmi2EnterInitializationMode", (void *), it);
    CALL("fmi2ExitInitializationMode", (void *), it);
    for (int i = 6; i < count && n < MOST; i++) {
        const char *equals = strchr(words[i], '=');
        references[n] = (unsigned)atoi(words[i]);
        if (equals) {
            values[n] = atof(equals + 1);
            CALL("fmi2SetReal", (void *, const unsigned *, size_t, const double *), it, &references[n], 1, &values[n]);
        } else {
            n++;
        }
    }
    for (int i = 0; i < atoi(words[5]); i++, time += step) {
        void *state = NULL;
        CALL("fmi2GetFMUstate", (void *, void **), it, &state);
        CALL("fmi2DoStep", (void *, double, double, int), it, time, step, 0);
        CALL("fmi2SetFMUstate", (void *, void *), it, state);
        CALL("fmi2DoStep", (void *, double, double, int), it, time, step, 1);
        CALL("fmi2FreeFMUstate", (void *, void **), it, &state);
    }
    CALL("fmi2GetReal", (void *, const unsigned *, size_t, double *), it, references, n, values);
    for (unsigned i = 0; i < n; i++) printf("%.17g\n", values[i]);
    CALL("fmi2Terminate", (void *), it);
    ((void (*)(void *))function("fmi2FreeInstance"))(it);
    return dlclose(library);
}
