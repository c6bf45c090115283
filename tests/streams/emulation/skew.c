/* Gives one process another monotonic clock, and delays its answers to clock probes.
 *
 *     reads(t) = t + offset + ppm * 1e-6 * (t - ref) + wander * sin(2 pi (t - ref) / period)
 *                  + step, once t >= step_at
 *                  + slew * (t - slew_at), for slew_s seconds, and what it has come to after that
 *
 * t is the true CLOCK_MONOTONIC, which stays reachable by a raw system call. Loaded by LD_PRELOAD,
 * set by the environment: SKEW_OFFSET, SKEW_PPM, SKEW_REF, SKEW_WANDER, SKEW_PERIOD, SKEW_STEP,
 * SKEW_STEP_AT, SKEW_SLEW, SKEW_SLEW_AT, SKEW_SLEW_S and SKEW_REPLY in seconds (SKEW_REPLY is the
 * mean of an exponential delay). Deadlines on the clock are mapped back to the first moment, from now
 * on, at which the clock reads them: a reading that a step back lets come twice is due at its first
 * time while that lies ahead, one that a step forward leaves out is due at the step.
 *
 *     gcc -O2 -fPIC -shared -o skew.so skew.c -ldl -lm
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <math.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

static long double offset, rate, ref, wander, period, step, step_at, reply;
static long double slew, slew_at, slew_s;
static int ready;

static long double setting(const char *name, long double otherwise) {
    const char *text = getenv(name);
    return text ? strtold(text, 0) : otherwise;
}

__attribute__((constructor)) static void read_settings(void) {
    offset = setting("SKEW_OFFSET", 0);
    rate = setting("SKEW_PPM", 0) * 1e-6L;
    ref = setting("SKEW_REF", 0);
    wander = setting("SKEW_WANDER", 0);
    period = setting("SKEW_PERIOD", 200);
    step = setting("SKEW_STEP", 0);
    step_at = setting("SKEW_STEP_AT", 1e18L);
    slew = setting("SKEW_SLEW", 0);
    slew_at = setting("SKEW_SLEW_AT", 1e18L);
    slew_s = setting("SKEW_SLEW_S", 0);
    reply = setting("SKEW_REPLY", 0);
    srand48(getpid());
    ready = 1;
}

static long double smooth(long double t) {
    long double turned = t - slew_at;
    turned = turned < 0 ? 0 : turned > slew_s ? slew_s : turned;
    return t + offset + rate * (t - ref) + wander * sinl(2 * M_PIl * (t - ref) / period)
           + slew * turned;
}

static long double skewed(long double t) { return smooth(t) + (t >= step_at ? step : 0); }

static long double when_smooth(long double reading) {
    long double t = (reading - offset + rate * ref) / (1 + rate);
    for (int i = 0; i < 12; i++) t -= (smooth(t) - reading) / (1 + rate);
    return t;
}

static long double due(long double reading, long double now) {
    if (now < step_at) {
        long double before = when_smooth(reading);
        if (before < step_at) return before;
        if (step > 0 && reading < smooth(step_at) + step) return step_at;
    }
    return when_smooth(reading - step);
}

double skew_map(double t) { return (double)skewed(t); }

double skew_due(double reading, double now) { return (double)due(reading, now); }

static long double seconds(const struct timespec *t) { return t->tv_sec + t->tv_nsec * 1e-9L; }

static struct timespec as_timespec(long double t) {
    struct timespec result;
    result.tv_sec = (time_t)floorl(t);
    result.tv_nsec = (long)((t - result.tv_sec) * 1e9L);
    return result;
}

static struct timespec true_deadline(const struct timespec *deadline) {
    struct timespec now;
    syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &now);
    return as_timespec(due(seconds(deadline), seconds(&now)));
}

#define REAL(name) \
    static __typeof__(name) *real; \
    if (!real) real = dlsym(RTLD_NEXT, #name)

int clock_gettime(clockid_t clock, struct timespec *t) {
    REAL(clock_gettime);
    int status = real(clock, t);
    if (status == 0 && ready && (clock == CLOCK_MONOTONIC || clock == CLOCK_MONOTONIC_COARSE))
        *t = as_timespec(skewed(seconds(t)));
    return status;
}

int clock_nanosleep(clockid_t clock, int flags, const struct timespec *wanted, struct timespec *left) {
    REAL(clock_nanosleep);
    struct timespec mapped;
    if (clock == CLOCK_MONOTONIC && (flags & TIMER_ABSTIME)) {
        mapped = true_deadline(wanted);
        wanted = &mapped;
    }
    return real(clock, flags, wanted, left);
}

int pthread_cond_clockwait(pthread_cond_t *condition, pthread_mutex_t *mutex, clockid_t clock,
                           const struct timespec *deadline) {
    REAL(pthread_cond_clockwait);
    struct timespec mapped;
    if (clock == CLOCK_MONOTONIC) {
        mapped = true_deadline(deadline);
        deadline = &mapped;
    }
    return real(condition, mutex, clock, deadline);
}

int sem_clockwait(sem_t *semaphore, clockid_t clock, const struct timespec *deadline) {
    REAL(sem_clockwait);
    struct timespec mapped;
    if (clock == CLOCK_MONOTONIC) {
        mapped = true_deadline(deadline);
        deadline = &mapped;
    }
    return real(semaphore, clock, deadline);
}

int timerfd_settime(int timer, int flags, const struct itimerspec *wanted, struct itimerspec *old) {
    REAL(timerfd_settime);
    struct itimerspec mapped = *wanted;
    if ((flags & TFD_TIMER_ABSTIME) && wanted->it_value.tv_sec > 0) {
        mapped.it_value = true_deadline(&wanted->it_value);
        wanted = &mapped;
    }
    return real(timer, flags, wanted, old);
}

/* liblsl answers clock probes, and queries, over UDP. */
static void delay_reply(int socket) {
    int kind = 0;
    socklen_t size = sizeof kind;
    if (reply <= 0 || getsockopt(socket, SOL_SOCKET, SO_TYPE, &kind, &size)) return;
    if (kind != SOCK_DGRAM) return;
    struct timespec wait = as_timespec(-reply * logl(1.0L - drand48()));
    syscall(SYS_nanosleep, &wait, 0);
}

ssize_t sendmsg(int socket, const struct msghdr *message, int flags) {
    REAL(sendmsg);
    delay_reply(socket);
    return real(socket, message, flags);
}

ssize_t sendto(int socket, const void *data, size_t size, int flags, const struct sockaddr *address,
               socklen_t length) {
    REAL(sendto);
    delay_reply(socket);
    return real(socket, data, size, flags, address, length);
}
