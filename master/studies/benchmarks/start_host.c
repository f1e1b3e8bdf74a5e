/* A plain host that times an FMU: start_host LIBRARY RESOURCES GUID STEPS [VR=VALUE]...
   Prints ms from instantiation to the end of initialisation, with the parameters VR=VALUE set; us of a step of 0.1 s under a motion of six
   inputs from reference 0 on, and of a scalar get. */
#define _POSIX_C_SOURCE 199309L
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct { void *logger, *allocate, *release, *finished, *environment; } Callbacks;
static void *library;

static void note(void *environment, const char *name, int status, const char *category, const char *message, ...) {
    (void)environment, (void)name, (void)category;
    if (status > 1) fprintf(stderr, "%s\n", message);
}

static double now(void) {
    struct timespec at;
    clock_gettime(CLOCK_MONOTONIC, &at);
    return (double)at.tv_sec + 1e-9 * (double)at.tv_nsec;
}

#define FIND(name, types) ((int (*) types)dlsym(library, name))

int main(int count, char **words) {
    Callbacks callbacks = {(void *)note, NULL, NULL, NULL, NULL};
    library = count > 4 ? dlopen(words[1], RTLD_NOW | RTLD_LOCAL) : NULL;
    if (!library) return fprintf(stderr, "%s\n", count > 4 ? dlerror() : "arguments"), 3;
    double begun = now();
    void *it = ((void *(*)(const char *, int, const char *, const char *, const Callbacks *, int, int))dlsym(library, "fmi2Instantiate"))(
        "unit", 1, words[3], words[2], &callbacks, 0, 0);
    if (!it) return 1;
    for (int i = 5; i < count; i++) {
        unsigned reference = (unsigned)atoi(words[i]);
        double value = atof(strchr(words[i], '=') + 1);
        if (FIND("fmi2SetReal", (void *, const unsigned *, size_t, const double *))(it, &reference, 1, &value) > 1) return 1;
    }
    int failed = FIND("fmi2SetupExperiment", (void *, int, double, double, int, double))(it, 0, 0.0, 0.0, 0, 0.0) > 1;
    failed |= FIND("fmi2EnterInitializationMode", (void *))(it) > 1;
    failed |= FIND("fmi2ExitInitializationMode", (void *))(it) > 1;
    double started = now();
    if (failed) return 1;
    int (*step)(void *, double, double, int) = FIND("fmi2DoStep", (void *, double, double, int));
    int (*set)(void *, const unsigned *, size_t, const double *) = FIND("fmi2SetReal", (void *, const unsigned *, size_t, const double *));
    int (*get)(void *, const unsigned *, size_t, double *) = FIND("fmi2GetReal", (void *, const unsigned *, size_t, double *));
    unsigned references[6] = {0, 1, 2, 3, 4, 5};
    double motion[6] = {0}, value = 0.0, sum = 0.0;
    int steps = atoi(words[4]), gets = 1000000;
    for (int i = 0; i < steps; i++) {
        motion[2] = 1.047 * sin(0.5236 * (0.1 * i + 0.05)); /* m/s, of 2 m at 12 s */
        if (set(it, references, 6, motion) > 1 || step(it, 0.1 * i, 0.1, 1) > 1) return 1;
    }
    double stepped = now();
    for (int i = 0; i < gets; i++) {
        if (get(it, references + i % 6, 1, &value) > 1) return 1;
        sum += value;
    }
    double got = now();
    printf("%.3f %.3f %.4f %g\n", 1e3 * (started - begun), 1e6 * (stepped - started) / (steps > 0 ? steps : 1), 1e6 * (got - stepped) / gets, sum);
    return 0;
}
