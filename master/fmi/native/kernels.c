/* Between face.c and the unit's kernels, which numba has compiled: their way of taking arrays, and what they need of numba's runtime.

   The constants begin with the sizes of all vectors, which the kernels take from their arrays, and with the numbers of the messages that an
   unchanged unit has for its start, beside what the kernels say. Step and outputs may be there for two kinds of processor, of which the
   better one that this processor is of is taken. A kernel that fails where it cannot, without memory, gives an error. */
#include "face.h"

#include <stdlib.h>

/* numba's runtime: arrays that a kernel makes are counted, and freed by it. The data come straight behind, aligned for the widest lanes. */

typedef struct {
    int64_t references;
    void (*release)(void *, size_t, void *);
    void *about, *data;
    size_t size;
    void *allocator;
} MemInfo;

void *NRT_Allocate(size_t size) { return malloc(size); }
void NRT_Free(void *data) { free(data); }
void NRT_MemInfo_call_dtor(MemInfo *it) { free(it); }

void *NRT_MemInfo_alloc_aligned(size_t size, unsigned align) {
    MemInfo *it = malloc(sizeof *it + size + align);
    if (!it) return NULL;
    *it = (MemInfo){.references = 1, .size = size};
    it->data = (void *)(((uintptr_t)(it + 1) + align - 1) / align * align);
    return it;
}

void *NRT_MemInfo_alloc(size_t size) { return NRT_MemInfo_alloc_aligned(size, 16); }

/* Takes the place of an instruction of x86 that counts down, atomically: an array is seen by one thread only. */
int8_t release_reference(int64_t *references, int64_t n, int32_t condition) {
    (void)condition;
    return (*references -= n) == 0;
}

/* Strides of a contiguous array in another shape; the kernels reshape no other arrays. */
int numba_attempt_nocopy_reshape(int64_t nd, const int64_t *dims, const int64_t *strides, int64_t new_nd, const int64_t *new_dims,
                                 int64_t *new_strides, int64_t item, int fortran) {
    (void)nd, (void)dims, (void)strides, (void)fortran;
    for (int64_t i = new_nd; i-- > 0; item *= new_dims[i]) new_strides[i] = item;
    return 1;
}

/* the kernels */

enum { N_CONSTANTS, N_STATE, N_INPUTS, N_OUTPUTS, N_PARAMETERS, FIRST_REMARK, N_REMARKS, N_SIZES };
#define ARRAY void *, void *, int64_t, int64_t, double *, int64_t, int64_t
#define GIVE(vector, size) NULL, NULL, (size), 8, (double *)(vector), (size), 8
#define CONSTANTS(c) GIVE((c) + N_SIZES, (int64_t)(c)[N_CONSTANTS] - N_SIZES)
#define SIZED(c, vector, which) GIVE(vector, (int64_t)(c)[which])
#define NOTES GIVE(notes, N_NOTES)

int32_t kernel_constants_base(int64_t *, void **, ARRAY, ARRAY, ARRAY, ARRAY);
int32_t kernel_start_base(int64_t *, void **, ARRAY, ARRAY, ARRAY, ARRAY, double, ARRAY, ARRAY);

#define FAST(level) \
    int32_t kernel_step_##level(int64_t *, void **, ARRAY, ARRAY, double, double, ARRAY, ARRAY, ARRAY); \
    int32_t kernel_outputs_##level(int64_t *, void **, ARRAY, ARRAY, int64_t, ARRAY);

FAST(base)
#ifdef LEVELS
FAST(v3)
#include <cpuid.h>
#include <stdatomic.h>

/* Whether processor and system know AVX2, FMA and BMI2. Found out once, as virtual machines take long over the question. */
static int has_v3(void) {
    static atomic_int known; /* 0: not yet, 1: no, 2: yes */
    int answer = atomic_load_explicit(&known, memory_order_relaxed);
    if (!answer) {
        unsigned a, b = 0, c = 0, d, low = 0, high;
        int there = __get_cpuid(1, &a, &b, &c, &d) && (c & bit_FMA) && (c & bit_OSXSAVE) && (c & bit_AVX);
        if (there) __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
        there = there && (low & 6) == 6 && __get_cpuid_count(7, 0, &a, &b, &c, &d) && (b & bit_AVX2) && (b & bit_BMI2) && (b & bit_BMI);
        answer = there ? 2 : 1;
        atomic_store_explicit(&known, answer, memory_order_relaxed);
    }
    return answer == 2;
}

#define CALL(kernel, ...) (has_v3() ? kernel_##kernel##_v3(__VA_ARGS__) : kernel_##kernel##_base(__VA_ARGS__))
#else
#define CALL(kernel, ...) kernel_##kernel##_base(__VA_ARGS__)
#endif

int64_t unit_constants(const double *exported, const double *parameters, double *constants, double *notes) {
    int64_t status = ERROR;
    void *failure = NULL;
    int done = !kernel_constants_base(&status, &failure, CONSTANTS(exported), SIZED(exported, parameters, N_PARAMETERS),
                                      GIVE(constants + N_SIZES, (int64_t)exported[N_CONSTANTS] - N_SIZES), NOTES);
    return done ? status : ERROR;
}

/* Put the remarks of an unchanged unit before the notes. */
static void add_remarks(const double *constants, double *notes) {
    double *end = notes + 1;
    for (double left = notes[0]; left > 0; left--) end += 3 + (int64_t)end[2];
    int64_t n = (int64_t)constants[N_REMARKS], shift = 3 * n;
    if (end + shift > notes + N_NOTES) return;
    memmove(notes + 1 + shift, notes + 1, (size_t)(end - notes - 1) * sizeof *notes);
    for (int64_t i = 0; i < n; i++) {
        double *at = notes + 1 + 3 * i;
        at[0] = WARNING, at[1] = constants[FIRST_REMARK] + (double)i, at[2] = 0;
    }
    notes[0] += (double)n;
}

int64_t unit_start(const double *constants, const double *exported, const double *exported_state, const double *inputs, double time, double *state,
                   double *notes) {
    int64_t status = ERROR;
    void *failure = NULL;
    int done = !kernel_start_base(&status, &failure, CONSTANTS(constants), CONSTANTS(exported), SIZED(constants, exported_state, N_STATE),
                                  SIZED(constants, inputs, N_INPUTS), time, SIZED(constants, state, N_STATE), NOTES);
    if (done && status == OK && equal(constants, exported, (int64_t)exported[N_CONSTANTS])) add_remarks(constants, notes);
    return done ? status : ERROR;
}

int64_t unit_step(const double *constants, const double *inputs, double time, double h, const double *state, double *next, double *notes) {
    int64_t status = ERROR;
    void *failure = NULL;
    int done = !CALL(step, &status, &failure, CONSTANTS(constants), SIZED(constants, inputs, N_INPUTS), time, h, SIZED(constants, state, N_STATE),
                     SIZED(constants, next, N_STATE), NOTES);
    return done ? status : DISCARD;
}

void unit_outputs(const double *constants, const double *state, int64_t group, double *outputs) {
    int64_t nothing = 0;
    void *failure = NULL;
    CALL(outputs, &nothing, &failure, CONSTANTS(constants), SIZED(constants, state, N_STATE), group, SIZED(constants, outputs, N_OUTPUTS));
}
