/* What Wine 8 leaves out of ucrtbase: functions of complex numbers (NumPy, SciPy), the
   floating-point environment (HDF5), and the error number of a lock that another file has.

   Each is named own_X here and exported as X; build.sh forwards the rest to Wine's. On Windows a long
   double is a double. */
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <windows.h>
#include <xmmintrin.h>

typedef struct { double re, im; } Pair;
typedef struct { float re, im; } PairF;

#define TAKEN(z) __builtin_complex((double)(z).re, (double)(z).im)
#define GIVEN(T, value) { double complex w = value; T o = { creal(w), cimag(w) }; return o; }

#define TO_COMPLEX(name, of) \
    Pair own_##name(Pair z) GIVEN(Pair, of(TAKEN(z))) \
    Pair own_##name##l(Pair z) GIVEN(Pair, of(TAKEN(z))) \
    PairF own_##name##f(PairF z) GIVEN(PairF, of(TAKEN(z)))
#define TO_REAL(name, of) \
    double own_##name(Pair z) { return of(TAKEN(z)); } \
    double own_##name##l(Pair z) { return of(TAKEN(z)); } \
    float own_##name##f(PairF z) { return of(TAKEN(z)); }

static double complex to_base_10(double complex z) { return clog(z) / log(10.0); }
static double squared(double complex z) { return creal(z) * creal(z) + cimag(z) * cimag(z); }

TO_COMPLEX(cacos, cacos) TO_COMPLEX(cacosh, cacosh) TO_COMPLEX(casin, casin)
TO_COMPLEX(casinh, casinh) TO_COMPLEX(catan, catan) TO_COMPLEX(catanh, catanh)
TO_COMPLEX(ccos, ccos) TO_COMPLEX(ccosh, ccosh) TO_COMPLEX(cexp, cexp) TO_COMPLEX(clog, clog)
TO_COMPLEX(clog10, to_base_10) TO_COMPLEX(conj, conj) TO_COMPLEX(cproj, cproj)
TO_COMPLEX(csin, csin) TO_COMPLEX(csinh, csinh) TO_COMPLEX(csqrt, csqrt) TO_COMPLEX(ctan, ctan)
TO_COMPLEX(ctanh, ctanh)
TO_REAL(cabs, cabs) TO_REAL(carg, carg) TO_REAL(creal, creal) TO_REAL(cimag, cimag)
TO_REAL(norm, squared)

Pair own_cpow(Pair z, Pair y) GIVEN(Pair, cpow(TAKEN(z), TAKEN(y)))
Pair own_cpowl(Pair z, Pair y) GIVEN(Pair, cpow(TAKEN(z), TAKEN(y)))
PairF own_cpowf(PairF z, PairF y) GIVEN(PairF, cpow(TAKEN(z), TAKEN(y)))

/* What compilers make of z = x + y*I, and of products. */
#define ARITHMETIC(prefix, T, real) \
    T own_##prefix##build(real re, real im) { T o = { re, im }; return o; } \
    T own_##prefix##mulcr(T a, real b) { T o = { a.re * b, a.im * b }; return o; } \
    T own_##prefix##mulcc(T a, T b) \
    { \
        T o = { a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re }; \
        return o; \
    }
ARITHMETIC(_C, Pair, double) ARITHMETIC(_LC, Pair, double) ARITHMETIC(_FC, PairF, float)

typedef struct { unsigned long control, status; } Environment;

enum { RAISED = 0x3f, MASKED = 0x1f80 };

int own_fegetenv(Environment *environment)
{
    environment->control = _mm_getcsr() & ~RAISED;
    environment->status = _mm_getcsr() & RAISED;
    return 0;
}

int own_feholdexcept(Environment *environment)
{
    own_fegetenv(environment);
    _mm_setcsr((_mm_getcsr() | MASKED) & ~RAISED);
    return 0;
}

int own_fesetenv(const Environment *environment)
{
    unsigned long control = environment->control; /* FE_DFL_ENV is all zeros */
    _mm_setcsr(control ? control | environment->status : MASKED);
    return 0;
}

int own_feupdateenv(const Environment *environment)
{
    unsigned raised = _mm_getcsr() & RAISED;
    own_fesetenv(environment);
    _mm_setcsr(_mm_getcsr() | raised);
    return 0;
}

/* Wine's refuses a lock with -1, as it should, and with whatever error number was there before. */
int own__locking(int file, int mode, long bytes)
{
    HMODULE wine = GetModuleHandleA("ucrtwine.dll");
    int *(*number)(void) = (int *(*)(void))(void *)GetProcAddress(wine, "_errno");
    int (*locking)(int, int, long) = (int (*)(int, int, long))(void *)GetProcAddress(wine, "_locking");
    int refused;
    *number() = 0;
    refused = locking(file, mode, bytes);
    if (refused && !*number())
        *number() = EACCES;
    return refused;
}
