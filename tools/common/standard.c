#define _POSIX_C_SOURCE 200809L /* fcntl, signals */
#include "standard.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "message.h"

/* If standard files are closed, the next files opened would take their place and receive what is
 * printed. With these in place writing to stdout fails, as it should; output to stderr is lost. */
static void reserve_standard_files(void) {
  for (int fd = 0; fd <= 2; fd++)
    if (fcntl(fd, F_GETFD) == -1 && errno == EBADF)
      open("/dev/null", fd == 2 ? O_WRONLY : O_RDONLY);
}

void standard_begin(void) {
  reserve_standard_files();
  signal(SIGPIPE, SIG_IGN);
  signal(SIGXFSZ, SIG_IGN); /* a write beyond the limit of file sizes fails, as on a full disk */
}

/* Set errno to the reason of an earlier failure: that of another attempt. */
static void retry_write(void) {
  errno = 0;
  if (write(STDOUT_FILENO, "\n", 1) == 1) errno = 0;
}

int standard_end(int status) {
  if (ferror(stdout)) retry_write();
  else {
    errno = 0;
    if (fclose(stdout) == 0) return status;
  }
  report_error("cannot write to standard output%s%s", errno ? ": " : "",
               errno ? strerror(errno) : "");
  return status ? status : EXIT_ERROR;
}
