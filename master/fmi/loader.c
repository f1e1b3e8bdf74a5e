/* FMI 2.0 co-simulation binding of an exported FMU: needs nothing but the C library, finds Python itself (Linux).

   Every call becomes a request of bytes (function, instance, arguments), which resources/runtime.py answers with
   (status, result, log). It runs
     1. in a process of its own, by the interpreter that PIPELAY_PYTHON names;
     2. in the host's interpreter, if the host runs one that has numpy and numba;
     3. in a process of the interpreter that exported the FMU (resources/python.txt).
   A process serves all instances of the library, ends with it, and cannot take the host down. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

enum { OK, WARNING, DISCARD, ERROR };
enum { INSTANTIATE, FREE, SETUP, ENTER, EXIT, TERMINATE, RESET, STEP, GET_STATE, SET_STATE, FREE_STATE, STATE_SIZE, STATE_BYTES,
       READ_STATE, GET = 20, SET = 30 };
enum { REAL, INTEGER, BOOLEAN, STRING };
enum { LONGEST_PATH = 4096, LONGEST_TEXT = 8192 };
#define PATH_IN(buffer, folder, rest) snprintf(buffer, sizeof buffer, "%.4000s/" rest, folder)

typedef void (*Logger)(void *environment, const char *name, int status, const char *category, const char *message, ...);
typedef struct {
    Logger logger;
    void *allocate, *release, *step_finished;
    void *environment;
} Callbacks;

typedef struct {
    char *data;
    size_t size, room;
} Buffer;

typedef struct Instance {
    struct Instance *next;
    int32_t id;
    int logging;
    char *name;
    Logger logger;
    void *environment;
    double time;
    Buffer request, reply;
} Instance;

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER; /* of the list, the counters and the start */
static pthread_mutex_t line = PTHREAD_MUTEX_INITIALIZER; /* of the socket */
static Instance *instances;
static int32_t last_id;
static uint64_t last_state;
static int channel = -1;
static pid_t server;

static struct { /* of the host's Python */
    int (*initialized)(void), (*ensure)(void), (*callable)(void *);
    void (*release)(int), (*forget)(void *), (*clear)(void);
    void *(*import)(const char *), *(*method)(void *, const char *, const char *, ...), *(*item)(void *, const char *);
    void *(*call)(void *, ...), *(*text)(const char *), *(*bytes)(const char *, ssize_t);
    char *(*data)(void *);
    ssize_t (*size)(void *);
    void *handle;
} py;

/* bytes */

static int reserve(Buffer *buffer, size_t size) {
    if (size > buffer->room) {
        char *data = realloc(buffer->data, size + 256);
        if (!data) return 0;
        buffer->data = data;
        buffer->room = size + 256;
    }
    return 1;
}

static void put(Buffer *buffer, const void *data, size_t size) {
    if (size && reserve(buffer, buffer->size + size)) {
        memcpy(buffer->data + buffer->size, data, size);
        buffer->size += size;
    }
}

static void put_text(Buffer *buffer, const char *text) {
    put(buffer, text ? text : "", strlen(text ? text : "") + 1);
}

static int move(int writing, void *data, size_t size) {
    for (char *at = data; size;) {
        ssize_t done = writing ? send(channel, at, size, MSG_NOSIGNAL) : recv(channel, at, size, 0);
        if (done < 0 && errno == EINTR) continue;
        if (done <= 0) return 0;
        at += done;
        size -= (size_t)done;
    }
    return 1;
}

/* messages */

static void say(Instance *it, int status, const char *category, const char *message) {
    if (it->logger && (status > OK || it->logging)) it->logger(it->environment, it->name, status, category, message);
}

static int complain(Instance *it, const char *format, ...) {
    char text[LONGEST_TEXT], escaped[2 * LONGEST_TEXT], *out = escaped;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    for (char *in = text; *in; *out++ = *in++) /* hosts take the message for a printf format */
        if (*in == '%') *out++ = '%';
    *out = 0;
    say(it, ERROR, "logStatusError", escaped);
    return ERROR;
}

static Instance *known(void *component) {
    pthread_mutex_lock(&lock);
    Instance *it = instances;
    while (it && it != component) it = it->next;
    pthread_mutex_unlock(&lock);
    return it;
}

/* the other side */

static int receive(Buffer *reply) {
    uint32_t size = 0;
    reply->size = 0;
    if (!move(0, &size, sizeof size) || !reserve(reply, size) || !move(0, reply->data, size)) return 0;
    reply->size = size;
    return 1;
}

static int ask_process(Buffer *request, Buffer *reply) {
    uint32_t size = (uint32_t)request->size;
    pthread_mutex_lock(&line);
    int done = channel >= 0 && move(1, &size, sizeof size) && move(1, request->data, size) && receive(reply);
    pthread_mutex_unlock(&line);
    return done;
}

static int ask_host(Buffer *request, Buffer *reply) {
    if (!py.initialized()) return 0;
    int state = py.ensure(), done = 0;
    void *bytes = py.bytes(request->data, (ssize_t)request->size), *answer = bytes ? py.call(py.handle, bytes, NULL) : NULL;
    reply->size = 0;
    if (answer) {
        put(reply, py.data(answer), (size_t)py.size(answer));
        done = reply->size > 0;
        py.forget(answer);
    } else {
        py.clear();
    }
    if (bytes) py.forget(bytes);
    py.release(state);
    return done;
}

/* Sends the request; hands on the log; result points into the reply. */
static int ask(Instance *it, const char **result, size_t expected) {
    uint32_t head[2] = {ERROR, 0};
    Buffer *reply = &it->reply;
    if (it->request.size > UINT32_MAX) return complain(it, "%zu bytes in one call are too many", it->request.size);
    if (!(py.handle ? ask_host : ask_process)(&it->request, reply) || reply->size < sizeof head)
        return complain(it, "the FMU's Python has ended");
    memcpy(head, reply->data, sizeof head);
    const char *at = reply->data + sizeof head + head[1], *end = reply->data + reply->size;
    while (at < end) {
        int32_t status;
        memcpy(&status, at, sizeof status);
        const char *category = at + sizeof status, *message = category + strlen(category) + 1;
        say(it, status, category, message);
        at = message + strlen(message) + 1;
    }
    if (head[0] <= WARNING && expected != (size_t)-1 && head[1] != expected) return complain(it, "an answer of %u bytes, not %zu", head[1], expected);
    if (result) *result = reply->data + sizeof head;
    return (int)head[0];
}

static void begin(Instance *it, int32_t function) {
    it->request.size = 0;
    put(&it->request, &function, sizeof function);
    put(&it->request, &it->id, sizeof it->id);
}

static int simple(void *component, int function) {
    Instance *it = known(component);
    if (!it) return ERROR;
    begin(it, function);
    return ask(it, NULL, 0);
}

/* finding Python */

static int start_in_host(const char *resources) {
    struct { void *place; const char *name; } symbols[] = {
        {&py.initialized, "Py_IsInitialized"}, {&py.ensure, "PyGILState_Ensure"}, {&py.release, "PyGILState_Release"},
        {&py.forget, "Py_DecRef"}, {&py.clear, "PyErr_Clear"}, {&py.import, "PyImport_ImportModule"}, {&py.callable, "PyCallable_Check"},
        {&py.method, "PyObject_CallMethod"}, {&py.item, "PyDict_GetItemString"}, {&py.call, "PyObject_CallFunctionObjArgs"},
        {&py.text, "PyUnicode_FromString"}, {&py.bytes, "PyBytes_FromStringAndSize"}, {&py.data, "PyBytes_AsString"}, {&py.size, "PyBytes_Size"}};
    for (size_t i = 0; i < sizeof symbols / sizeof *symbols; i++) {
        void *found = dlsym(RTLD_DEFAULT, symbols[i].name);
        if (!found) return 0;
        memcpy(symbols[i].place, &found, sizeof found);
    }
    if (!py.initialized()) return 0;
    char path[LONGEST_PATH];
    PATH_IN(path, resources, "runtime.py");
    int state = py.ensure();
    static const char run[] = "with open(path, 'rb') as file:\n    exec(compile(file.read(), path, 'exec'))"; /* imports nothing */
    void *builtins = py.import("builtins"), *globals = builtins ? py.method(builtins, "dict", NULL) : NULL;
    void *given = globals ? py.method(globals, "__setitem__", "ss", "path", path) : NULL;
    void *ran = given ? py.method(builtins, "exec", "sO", run, globals) : NULL, *load = ran ? py.item(globals, "load_in_host") : NULL;
    void *folder = load ? py.text(resources) : NULL, *handle = folder ? py.call(load, folder, NULL) : NULL;
    if (handle && py.callable(handle)) py.handle = handle;
    void *held[] = {builtins, globals, given, ran, folder, py.handle ? NULL : handle};
    for (size_t i = 0; i < sizeof held / sizeof *held; i++)
        if (held[i]) py.forget(held[i]);
    py.clear();
    py.release(state);
    return py.handle != NULL;
}

/* `fd`, moved away from the standard streams where the host has closed those. */
static int above_streams(int fd) {
    int moved = fd > 2 ? fd : fcntl(fd, F_DUPFD_CLOEXEC, 3);
    if (moved != fd) close(fd);
    return moved;
}

static int start_process(Instance *it, const char *python, const char *resources, const char *advice) {
    int ends[2], code = 0;
    char path[LONGEST_PATH];
    PATH_IN(path, resources, "runtime.py");
    if (access(python, X_OK)) return complain(it, "Python %s: %s%s", python, strerror(errno), advice);
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends)) return complain(it, "no socket: %s", strerror(errno));
    ends[0] = above_streams(ends[0]), ends[1] = above_streams(ends[1]);
    pid_t pid = fork();
    if (!pid) { /* a session of its own: Ctrl-C is for the host */
        setsid();
        while ((code = open("/dev/null", O_RDWR)) >= 0 && code < 3) {} /* streams that the host has closed */
        if (code > 2) close(code);
        dup2(2, 1);
        if (ends[1] == 3 ? !fcntl(3, F_SETFD, 0) : dup2(ends[1], 3) == 3) execl(python, python, "-I", "-B", path, "3", (char *)NULL);
        _exit(127);
    }
    close(ends[1]);
    channel = ends[0];
    server = pid;
    if (pid > 0 && receive(&it->reply) && it->reply.size > 0 && it->reply.data[0] == 0) return OK;
    char *reason = it->reply.size > 1 ? it->reply.data + 1 : NULL; /* ends with a zero byte */
    close(channel);
    channel = -1;
    if (pid > 0) waitpid(pid, &code, 0);
    return reason ? complain(it, "Python %s: %s%s", python, reason, advice)
                  : complain(it, "Python %s ended at its start, exit code %d%s", python, WIFEXITED(code) ? WEXITSTATUS(code) : -1, advice);
}

static int start(Instance *it, const char *resources) {
    static const char advice[] = "; set PIPELAY_PYTHON to a Python with numpy and numba";
    char path[LONGEST_PATH], python[LONGEST_PATH];
    if (py.handle || channel >= 0) return OK;
    PATH_IN(path, resources, "runtime.py");
    if (access(path, R_OK)) return complain(it, "resources: %s: %s", path, strerror(errno));
    const char *chosen = getenv("PIPELAY_PYTHON");
    if (chosen && *chosen) return start_process(it, chosen, resources, " (PIPELAY_PYTHON)");
    if (start_in_host(resources)) return OK;
    PATH_IN(path, resources, "python.txt");
    FILE *file = fopen(path, "r");
    size_t length = file ? fread(python, 1, sizeof python - 1, file) : 0;
    if (file) fclose(file);
    python[length] = 0;
    return start_process(it, python, resources, advice);
}

__attribute__((destructor)) static void stop(void) {
    if (channel >= 0) {
        close(channel);
        waitpid(server, NULL, 0);
    }
}

/* "file:///a%20b" to "/a b" */
static void decode(const char *uri, char *path, size_t size) {
    const char *in = uri;
    if (!strncmp(in, "file:", 5)) {
        in += 5;
        if (!strncmp(in, "//", 2)) {
            in += 2;
            in = strchr(in, '/') ? strchr(in, '/') : in;
        }
    }
    size_t n = 0;
    for (unsigned code; *in && n + 1 < size; n++) {
        if (in != uri && *in == '%' && sscanf(in + 1, "%2x", &code) == 1) {
            path[n] = (char)code;
            in += 3;
        } else {
            path[n] = *in++;
        }
    }
    while (n > 1 && path[n - 1] == '/') n--;
    path[n] = 0;
}

/* FMI 2.0 */

#define FMI __attribute__((visibility("default")))
typedef unsigned Reference;

FMI const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI const char *fmi2GetVersion(void) { return "2.0"; }

FMI int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const categories[]) {
    Instance *it = known(c);
    (void)n, (void)categories;
    if (!it) return ERROR;
    it->logging = on;
    return OK;
}

/* Ends an instance; the host's Python is let go of with the last one. */
static void discard(Instance *it) {
    pthread_mutex_lock(&lock);
    Instance **place = &instances;
    while (*place && *place != it) place = &(*place)->next;
    if (*place) *place = it->next;
    void *handle = instances ? NULL : py.handle;
    if (handle) py.handle = NULL;
    pthread_mutex_unlock(&lock);
    if (handle && py.initialized()) {
        int state = py.ensure();
        py.forget(handle);
        py.release(state);
    }
    free(it->request.data);
    free(it->reply.data);
    free(it->name);
    free(it);
}

FMI void *fmi2Instantiate(const char *name, int type, const char *guid, const char *location, const Callbacks *callbacks, int visible, int logging) {
    char resources[LONGEST_PATH];
    (void)visible;
    Instance *it = calloc(1, sizeof *it);
    if (!it) return NULL;
    it->name = strdup(name ? name : "");
    it->logging = logging;
    if (callbacks) it->logger = callbacks->logger, it->environment = callbacks->environment;
    int status = OK;
    if (type != 1) status = complain(it, "only co-simulation is offered");
    else if (!location) status = complain(it, "no resource location was given");
    if (status == OK) {
        decode(location, resources, sizeof resources);
        pthread_mutex_lock(&lock);
        status = start(it, resources);
        it->id = ++last_id;
        it->next = instances;
        instances = it;
        pthread_mutex_unlock(&lock);
    }
    if (status == OK) {
        begin(it, INSTANTIATE);
        put_text(&it->request, name);
        put_text(&it->request, guid);
        put_text(&it->request, resources);
        status = ask(it, NULL, 0);
    }
    if (status > WARNING) {
        discard(it);
        return NULL;
    }
    return it;
}

FMI void fmi2FreeInstance(void *c) {
    Instance *it = known(c);
    if (!it) return;
    begin(it, FREE);
    ask(it, NULL, 0);
    discard(it);
}

FMI int fmi2SetupExperiment(void *c, int tolerant, double tolerance, double from, int limited, double to) {
    Instance *it = known(c);
    if (!it) return ERROR;
    double numbers[5] = {tolerant ? 1 : 0, tolerance, from, limited ? 1 : 0, to};
    begin(it, SETUP);
    put(&it->request, numbers, sizeof numbers);
    it->time = from;
    return ask(it, NULL, 0);
}

FMI int fmi2EnterInitializationMode(void *c) { return simple(c, ENTER); }
FMI int fmi2ExitInitializationMode(void *c) { return simple(c, EXIT); }
FMI int fmi2Terminate(void *c) { return simple(c, TERMINATE); }
FMI int fmi2Reset(void *c) { return simple(c, RESET); }

FMI int fmi2DoStep(void *c, double time, double step, int final) {
    Instance *it = known(c);
    (void)final;
    if (!it) return ERROR;
    double numbers[2] = {time, step};
    begin(it, STEP);
    put(&it->request, numbers, sizeof numbers);
    int status = ask(it, NULL, 0);
    if (status <= WARNING) it->time = time + step;
    return status;
}

static int get(void *c, int kind, const Reference references[], size_t n, void *values, size_t each) {
    Instance *it = known(c);
    const char *result;
    if (!it) return ERROR;
    if (n && (!references || !values)) return complain(it, "get: no array was given");
    begin(it, GET + kind);
    put(&it->request, references, n * sizeof *references);
    int status = ask(it, &result, kind == STRING ? (size_t)-1 : n * each);
    if (status > WARNING || !n) return status;
    if (kind != STRING) memcpy(values, result, n * each);
    else for (size_t i = 0; i < n; i++, result += strlen(result) + 1) ((const char **)values)[i] = result; /* valid until the next call */
    return status;
}

static int set(void *c, int kind, const Reference references[], size_t n, const void *values, size_t each) {
    Instance *it = known(c);
    if (!it) return ERROR;
    if (n && (!references || !values)) return complain(it, "set: no array was given");
    begin(it, SET + kind);
    uint32_t count = (uint32_t)n;
    put(&it->request, &count, sizeof count);
    put(&it->request, references, n * sizeof *references);
    if (kind != STRING) put(&it->request, values, n * each);
    else for (size_t i = 0; i < n; i++) put_text(&it->request, ((const char *const *)values)[i]);
    return ask(it, NULL, 0);
}

#define ACCESS(Name, kind, type) \
    FMI int fmi2Get##Name(void *c, const Reference r[], size_t n, type v[]) { return get(c, kind, r, n, v, sizeof *v); } \
    FMI int fmi2Set##Name(void *c, const Reference r[], size_t n, const type v[]) { return set(c, kind, r, n, v, sizeof *v); }
ACCESS(Real, REAL, double)
ACCESS(Integer, INTEGER, int)
ACCESS(Boolean, BOOLEAN, int)
FMI int fmi2GetString(void *c, const Reference r[], size_t n, const char *v[]) { return get(c, STRING, r, n, v, 0); }
FMI int fmi2SetString(void *c, const Reference r[], size_t n, const char *const v[]) { return set(c, STRING, r, n, v, 0); }

/* A state is a number, never an address: a wrong one is found out, not followed. */
static int state_call(void *c, int function, uint64_t state, const void *data, size_t size, const char **result, size_t expected) {
    Instance *it = known(c);
    if (!it) return ERROR;
    begin(it, function);
    put(&it->request, &state, sizeof state);
    put(&it->request, data, size);
    return ask(it, result, expected);
}

static int new_state(void *c, int function, const void *data, size_t size, void **state) {
    if (!known(c)) return ERROR;
    if (!state || (size && !data)) return complain(c, "state: no place was given");
    if (!*state) {
        pthread_mutex_lock(&lock);
        *state = (void *)(uintptr_t)++last_state;
        pthread_mutex_unlock(&lock);
    }
    uint64_t number = (uintptr_t)*state;
    int status = state_call(c, function, number, data, size, NULL, 0);
    if (status > WARNING) *state = NULL;
    return status;
}

FMI int fmi2GetFMUstate(void *c, void **state) { return new_state(c, GET_STATE, NULL, 0, state); }
FMI int fmi2SetFMUstate(void *c, void *state) { return state_call(c, SET_STATE, (uintptr_t)state, NULL, 0, NULL, 0); }
FMI int fmi2DeSerializeFMUstate(void *c, const char data[], size_t size, void **state) {
    if (state) *state = NULL;
    return new_state(c, READ_STATE, data, size, state);
}

FMI int fmi2FreeFMUstate(void *c, void **state) {
    if (!known(c)) return ERROR;
    if (!state || !*state) return OK;
    int status = state_call(c, FREE_STATE, (uintptr_t)*state, NULL, 0, NULL, 0);
    *state = NULL;
    return status;
}

FMI int fmi2SerializedFMUstateSize(void *c, void *state, size_t *size) {
    const char *result;
    uint64_t number = 0;
    if (known(c) && !size) return complain(c, "state: no place for its size was given");
    int status = state_call(c, STATE_SIZE, (uintptr_t)state, NULL, 0, &result, sizeof number);
    if (status > WARNING) return status;
    memcpy(&number, result, sizeof number);
    *size = (size_t)number;
    return status;
}

FMI int fmi2SerializeFMUstate(void *c, void *state, char data[], size_t size) {
    const char *result;
    if (known(c) && !data) return complain(c, "state: no place for its bytes was given");
    int status = state_call(c, STATE_BYTES, (uintptr_t)state, NULL, 0, &result, size);
    if (status <= WARNING) memcpy(data, result, size);
    return status;
}

static int missing(void *c, const char *what) {
    Instance *it = known(c);
    return it ? complain(it, "%s: not offered", what) : ERROR;
}

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

FMI int fmi2GetRealStatus(void *c, int kind, double *value) {
    Instance *it = known(c);
    if (!it) return ERROR;
    if (kind != 2 || !value) return DISCARD; /* 2: fmi2LastSuccessfulTime */
    *value = it->time;
    return OK;
}
FMI int fmi2GetBooleanStatus(void *c, int kind, int *value) {
    if (!known(c)) return ERROR;
    if (kind != 3 || !value) return DISCARD; /* 3: fmi2Terminated */
    *value = 0;
    return OK;
}
FMI int fmi2GetStatus(void *c, int kind, int *value) { (void)kind, (void)value; return known(c) ? DISCARD : ERROR; }
FMI int fmi2GetIntegerStatus(void *c, int kind, int *value) { (void)kind, (void)value; return known(c) ? DISCARD : ERROR; }
FMI int fmi2GetStringStatus(void *c, int kind, const char **value) { (void)kind, (void)value; return known(c) ? DISCARD : ERROR; }
