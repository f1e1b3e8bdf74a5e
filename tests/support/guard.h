/* Memory of the C face and of the kernels under test: every block ends at a page that nobody may touch, and is no longer there once freed. */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

extern void *mmap(void *, size_t, int, int, int, long);
extern int mprotect(void *, size_t, int), munmap(void *, size_t);
enum { PAGE = 4096, READ_WRITE = 3, NOTHING = 0, PRIVATE_ANONYMOUS = 0x22 };

static inline void *guarded_malloc(size_t size) {
    size_t room = (size + 7) / 8 * 8, pages = (room + 2 * sizeof(size_t) + PAGE - 1) / PAGE * PAGE;
    char *first = mmap(NULL, pages + PAGE, READ_WRITE, PRIVATE_ANONYMOUS, -1, 0), *block = first + pages - room;
    mprotect(first + pages, PAGE, NOTHING);
    memset(first, 0xA5, pages);
    ((char **)block)[-1] = first;
    ((size_t *)block)[-2] = pages + PAGE;
    return block;
}

static inline void *guarded_calloc(size_t n, size_t size) { return memset(guarded_malloc(n * size), 0, n * size); }

static inline void guarded_free(void *block) {
    if (block) munmap(((char **)block)[-1], ((size_t *)block)[-2]);
}

#define malloc guarded_malloc
#define calloc guarded_calloc
#define free guarded_free
