/* Couples the pipe and the vessel of couple.h: each step the vessel moves under the last pull of the pipe, then the pipe moves with it.
   Prints the values WANTED at the end. Needs no C library but the system's, so that it is linked for Windows as the FMUs are. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "couple.h"

#ifdef _WIN32
__declspec(dllimport) void *__stdcall LoadLibraryA(const char *path);
__declspec(dllimport) void *__stdcall GetProcAddress(void *library, const char *name);
__declspec(dllimport) void *__stdcall GetStdHandle(unsigned which);
__declspec(dllimport) int __stdcall WriteFile(void *file, const void *data, unsigned size, unsigned *done, void *overlapped);
__declspec(dllimport) void __stdcall ExitProcess(unsigned code);
#define OPEN(path) LoadLibraryA(path)
#define FIND(library, name) GetProcAddress(library, name)
static void print(const char *text) {
    unsigned done;
    WriteFile(GetStdHandle((unsigned)-11), text, (unsigned)strlen(text), &done, NULL);
}
#else
#include <dlfcn.h>
#include <unistd.h>
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
static void print(const char *text) { (void)!write(1, text, strlen(text)); }
#endif

typedef struct { void *logger, *allocate, *release, *finished, *environment; } Callbacks;
typedef struct { void *library, *it; } Fmu;

static void note(void *environment, const char *name, int status, const char *category, const char *message, ...) {
    (void)environment, (void)name, (void)status, (void)category;
    print(message), print("\n");
}

static int failed;
#define CALL(fmu, name, types, ...) failed |= (((int (*) types)FIND((fmu).library, name))(__VA_ARGS__) > 1)

static Fmu start(const char *library, const char *resources, const char *guid) {
    static Callbacks callbacks = {(void *)note, NULL, NULL, NULL, NULL};
    Fmu fmu = {OPEN(library), NULL};
    if (fmu.library)
        fmu.it = ((void *(*)(const char *, int, const char *, const char *, const Callbacks *, int, int))FIND(fmu.library, "fmi2Instantiate"))(
            "unit", 1, guid, resources, &callbacks, 0, 0);
    if (!fmu.it) return print(fmu.library ? "not instantiated\n" : "no library\n"), failed = 1, fmu;
    CALL(fmu, "fmi2SetupExperiment", (void *, int, double, double, int, double), fmu.it, 0, 0.0, 0.0, 0, 0.0);
    CALL(fmu, "fmi2EnterInitializationMode", (void *), fmu.it);
    CALL(fmu, "fmi2ExitInitializationMode", (void *), fmu.it);
    return fmu;
}

static void get(Fmu fmu, const unsigned references[], size_t n, double values[]) {
    CALL(fmu, "fmi2GetReal", (void *, const unsigned *, size_t, double *), fmu.it, references, n, values);
}

static void set(Fmu fmu, const unsigned references[], size_t n, const double values[]) {
    CALL(fmu, "fmi2SetReal", (void *, const unsigned *, size_t, const double *), fmu.it, references, n, values);
}

static int run(void) {
    static const unsigned motion[] = MOTION, moved[] = MOVED, pull[] = PULL, pulled[] = PULLED, wanted[] = WANTED;
    double values[6], shown[sizeof wanted / sizeof *wanted];
    char line[40];
    Fmu vessel = start(VESSEL), pipe = start(PIPE);
    for (int i = 0; !failed && i < COUNT; i++) {
        get(pipe, pull, 6, values);
        set(vessel, pulled, 6, values);
        CALL(vessel, "fmi2DoStep", (void *, double, double, int), vessel.it, i * STEP, STEP, 1);
        get(vessel, motion, 6, values);
        set(pipe, moved, 6, values);
        CALL(pipe, "fmi2DoStep", (void *, double, double, int), pipe.it, i * STEP, STEP, 1);
    }
    if (failed) return print("failed\n"), 1;
    get(pipe, wanted, sizeof wanted / sizeof *wanted, shown);
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++) {
        snprintf(line, sizeof line, "%.17g\n", shown[i]);
        print(line);
    }
    return 0;
}

#ifdef _WIN32
void mainCRTStartup(void) { ExitProcess((unsigned)run()); }
#else
int main(void) { return run(); }
#endif
