/* What a library for Windows needs beside the system's own C library, so that it is linked without another one. */
#include <stdarg.h>
#include <stddef.h>

int _fltused = 1; /* the compiler's mark of floating-point numbers */

int DllMain(void *library, unsigned long reason, void *reserved) {
    (void)library, (void)reason, (void)reserved;
    return 1;
}

/* printf into a buffer, as the C standard has it */
int __stdio_common_vsprintf(unsigned long long options, char *buffer, size_t size, const char *format, void *locale, va_list arguments);
enum { STANDARD = 2 };

int vsnprintf(char *buffer, size_t size, const char *format, va_list arguments) {
    return __stdio_common_vsprintf(STANDARD, buffer, size, format, NULL, arguments);
}

int snprintf(char *buffer, size_t size, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(buffer, size, format, arguments);
    va_end(arguments);
    return length;
}

double _hypot(double x, double y);
double hypot(double x, double y) { return _hypot(x, y); }

double sin(double x);
double cos(double x);
__attribute__((optnone)) void sincos(double x, double *sine, double *cosine) { /* else it would be made a call of itself */
    *sine = sin(x);
    *cosine = cos(x);
}

/* Touches every page of a stack frame of rax bytes, as Windows wants; changes no register. */
__attribute__((naked)) void ___chkstk_ms(void) {
    __asm__("push %rcx\n"
            "push %rax\n"
            "cmp $0x1000, %rax\n"
            "lea 24(%rsp), %rcx\n"
            "jb 2f\n"
            "1: sub $0x1000, %rcx\n"
            "orq $0, (%rcx)\n"
            "sub $0x1000, %rax\n"
            "cmp $0x1000, %rax\n"
            "ja 1b\n"
            "2: sub %rax, %rcx\n"
            "orq $0, (%rcx)\n"
            "pop %rax\n"
            "pop %rcx\n"
            "ret\n");
}
