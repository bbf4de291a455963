#define _POSIX_C_SOURCE 200809L /* ssize_t */
#include "protocol.h"

#include <unistd.h>

int pipe_read(int fd, void *data, size_t size) {
  char *to = data;
  while (size > 0) {
    ssize_t got = read(fd, to, size);
    if (got <= 0) return 0;
    to += got, size -= (size_t)got;
  }
  return 1;
}

int pipe_write(int fd, const void *data, size_t size) {
  const char *from = data;
  while (size > 0) {
    ssize_t put = write(fd, from, size);
    if (put <= 0) return 0;
    from += put, size -= (size_t)put;
  }
  return 1;
}
