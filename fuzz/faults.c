// Faults for a program under test: loaded with LD_PRELOAD, told by the environment, kept from its children.
//
//   FAULT_CLOCK=N,S       after N readings the system's clock is S seconds off
//   FAULT_DISK=N          the disk is full after N bytes
//   FAULT_RENAME=N        the Nth renaming fails, and all later ones
//   FAULT_CHANGE=N,SIG    the signal comes before the Nth change on the disk: a write, sync, renaming or removal
//   FAULT_CPU=MS,SIG,SIG  the signal comes after MS milliseconds of CPU time; the second one 100 ms later
//   FAULT_NETWORK=1       a connection beyond this machine ends the process
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <netinet/in.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static long clock_after = -1, clock_jump, disk = -1, renames = -1, changes = -1, change_signal, no_network;

static void set_timer(long milliseconds, int signal) {
  timer_t timer;
  struct sigevent event = {.sigev_notify = SIGEV_SIGNAL, .sigev_signo = signal};
  struct itimerspec when = {.it_value = {milliseconds / 1000, milliseconds % 1000 * 1000000}};
  if (signal == 0 || timer_create(CLOCK_PROCESS_CPUTIME_ID, &event, &timer) != 0) return;
  timer_settime(timer, 0, &when, NULL);
}

__attribute__((constructor)) static void arm(void) {
  const char *said;
  long milliseconds;
  int first = 0, second = 0;
  if ((said = getenv("FAULT_CLOCK"))) sscanf(said, "%ld,%ld", &clock_after, &clock_jump);
  if ((said = getenv("FAULT_DISK"))) disk = atol(said);
  if ((said = getenv("FAULT_RENAME"))) renames = atol(said);
  if ((said = getenv("FAULT_CHANGE"))) sscanf(said, "%ld,%ld", &changes, &change_signal);
  if ((said = getenv("FAULT_NETWORK"))) no_network = atol(said);
  if ((said = getenv("FAULT_CPU")) && sscanf(said, "%ld,%d,%d", &milliseconds, &first, &second) >= 2) {
    set_timer(milliseconds, first);
    set_timer(milliseconds + 100, second);
  }
  const char *names[] = {"FAULT_CLOCK", "FAULT_DISK", "FAULT_RENAME", "FAULT_CHANGE", "FAULT_CPU"};
  for (int i = 0; i < 5; ++i) unsetenv(names[i]);
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int is_file(int descriptor) {
  struct stat status;
  return fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode);
}

static void change(void) {
  if (changes >= 0 && __atomic_sub_fetch(&changes, 1, __ATOMIC_SEQ_CST) == 0) kill(getpid(), (int)change_signal);
}

ssize_t write(int descriptor, const void *bytes, size_t count) {
  if ((disk >= 0 || changes >= 0) && is_file(descriptor)) {
    change();
    if (disk >= 0) {
      if (disk == 0 && count > 0) return errno = ENOSPC, -1;
      if (count > (size_t)disk) count = (size_t)disk;
      disk -= (long)count;
    }
  }
  return REAL(write)(descriptor, bytes, count);
}

int fsync(int descriptor) {
  change();
  return REAL(fsync)(descriptor);
}

int rename(const char *from, const char *to) {
  change();
  if (renames >= 0 && --renames <= 0) return renames = 0, errno = EIO, -1;
  return REAL(rename)(from, to);
}

int unlink(const char *path) {
  change();
  return REAL(unlink)(path);
}

static long off(void) { return clock_after >= 0 && (clock_after == 0 || --clock_after == 0) ? clock_jump : 0; }

int clock_gettime(clockid_t clock, struct timespec *now) {
  int failed = REAL(clock_gettime)(clock, now);
  if (!failed && clock == CLOCK_REALTIME) now->tv_sec += off();
  return failed;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone) {
  int failed = REAL(gettimeofday)(now, zone);
  if (!failed) now->tv_sec += off();
  return failed;
}

time_t time(time_t *out) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (out) *out = now.tv_sec;
  return now.tv_sec;
}

int connect(int socket, const struct sockaddr *address, socklen_t length) {
  if (no_network && (address->sa_family == AF_INET || address->sa_family == AF_INET6)) {
    fprintf(stderr, "a connection was asked for\n");
    abort();
  }
  return REAL(connect)(socket, address, length);
}
