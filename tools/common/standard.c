#define _POSIX_C_SOURCE 200809L /* fcntl, signals */
#include "standard.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

#include "message.h"

/* Where standard files are closed, the next file opened would take their place and get what is
 * printed. Here writing to stdout fails as it should, and what goes to stderr is lost. */
static void reserve_standard_files(void) {
  for (int fd = 0; fd <= 2; fd++)
    if (fcntl(fd, F_GETFD) == -1 && errno == EBADF)
      open("/dev/null", fd == 2 ? O_WRONLY : O_RDONLY);
}

void standard_begin(void) {
  reserve_standard_files();
  signal(SIGPIPE, SIG_IGN);
  signal(SIGXFSZ, SIG_IGN); /* a limit on file sizes is an error of the write, as a full disk is */
}

int standard_end(int status) {
  int failed = ferror(stdout);
  errno = 0;
  if (fclose(stdout) == 0 && !failed) return status;
  complain("cannot write to standard output%s%s", errno ? ": " : "", errno ? strerror(errno) : "");
  return status ? status : EXIT_ERROR;
}
