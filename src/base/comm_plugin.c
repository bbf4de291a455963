#include "base/comm_plugin.h"

#include "base/registry.h"

/* Static builds define the list of plugins that are linked in: X(mpi) ... */
#define X(name) const msim_comm_type *msim_comm_##name(void);
MSIM_LINKED_COMMS
#undef X

#define X(name) msim_comm_##name,
MS_REGISTRY_ENTRIES(msim_comm_entry_fn, MSIM_LINKED_COMMS)
#undef X

static const ms_registry_plugin known[] = {
    {.name = "mpi", .plugin = "mpi", .debian = "libopenmpi-dev", .conda = "openmpi"}, {NULL}};

static const ms_registry_member required_of_type[] = {
    MS_REGISTRY_MEMBER(msim_comm_type, name),    MS_REGISTRY_MEMBER(msim_comm_type, library),
    MS_REGISTRY_MEMBER(msim_comm_type, license), MS_REGISTRY_MEMBER(msim_comm_type, open),
    MS_REGISTRY_MEMBER(msim_comm_type, close),   {NULL}};

static const ms_registry comms = {.kind = "comm",
                                  .noun = "communicator",
                                  .abi = MSIM_COMM_ABI,
                                  .least_size = MSIM_COMM_TYPE_SIZE_1,
                                  .library = offsetof(msim_comm_type, library),
                                  .license = offsetof(msim_comm_type, license),
                                  .known = known,
                                  .required = required_of_type,
                                  .linked = linked,
                                  .enter = enter};

int32_t msim_comm_info(int32_t i, const char *plugin_path, msim_plugin_entry *entry,
                       msim_error *err) {
  return ms_registry_info(&comms, i, plugin_path, entry, err);
}

/*------------------------------------- check ----------------------------------------------------*/

static const ms_registry_member required[] = {MS_REGISTRY_MEMBER(msim_comm, name),
                                              MS_REGISTRY_MEMBER(msim_comm, sum),
                                              MS_REGISTRY_MEMBER(msim_comm, maximum),
                                              MS_REGISTRY_MEMBER(msim_comm, gather),
                                              MS_REGISTRY_MEMBER(msim_comm, gather_parts),
                                              MS_REGISTRY_MEMBER(msim_comm, broadcast),
                                              MS_REGISTRY_MEMBER(msim_comm, all_to_all),
                                              MS_REGISTRY_MEMBER(msim_comm, exchange_begin),
                                              MS_REGISTRY_MEMBER(msim_comm, exchange_end),
                                              MS_REGISTRY_MEMBER(msim_comm, reason),
                                              {NULL}};

msim_status ms_comm_plugin_check(const msim_comm *comm, msim_error *err) {
  if (comm->abi != MSIM_COMM_ABI || comm->size < MSIM_COMM_SIZE_1)
    return ms_error_set(err, MSIM_ERR_ABI,
                        "the communicator was built for ABI %u with %u bytes, but msim %s has ABI "
                        "%u with %zu; rebuild it",
                        comm->abi, comm->size, msim_version(), MSIM_COMM_ABI, MSIM_COMM_SIZE_1);
  for (const ms_registry_member *m = required; m->name; m++) {
    const void *pointer;
    memcpy(&pointer, (const char *)comm + m->offset, sizeof pointer);
    if (!pointer)
      return ms_error_set(err, MSIM_ERR_ARG, "the communicator's table lacks `%s`", m->name);
  }
  if (comm->nranks >= 1 && comm->rank >= 0 && comm->rank < comm->nranks) return MSIM_OK;
  return ms_error_set(err, MSIM_ERR_ARG,
                      "communicator '%s' has rank %d of %d; ranks are 0 to nranks - 1", comm->name,
                      comm->rank, comm->nranks);
}

/*------------------------------------- open and close -------------------------------------------*/

/* What msim_comm_open returns the first member of */
typedef struct plugin_comm {
  msim_comm comm; /* a copy of the plugin's */
  msim_comm *own; /* the plugin's */
  const msim_comm_type *type;
  ms_plugin_host host;
  msim_allocator alloc;
} plugin_comm;

/* The members of the table that this version has */
static void copy_table(plugin_comm *p) {
  memcpy(&p->comm, p->own, p->own->size < sizeof p->comm ? p->own->size : sizeof p->comm);
  p->comm.size = (uint32_t)(p->own->size < sizeof p->comm ? p->own->size : sizeof p->comm);
}

static msim_status open_comm(plugin_comm *p, const char *name, const void *from,
                             const char *plugin_path, msim_error *err) {
  const ms_registry_sources sources = {NULL, plugin_path, &p->alloc};
  const void *table;
  msim_status status = ms_registry_find(&comms, name, &sources, &table, err);
  if (status) return status;
  p->type = table;
  status = p->type->open(&p->host.base, from, &p->own);
  if (status) return ms_plugin_fail(&p->host, name, status, err);
  if (!p->own)
    return ms_error_set(err, MSIM_ERR_PLUGIN, "communicator '%s': open() returned no table", name);
  status = ms_comm_plugin_check(p->own, err);
  if (status) p->type->close(p->own);
  else copy_table(p);
  return status;
}

msim_status msim_comm_open(const char *name, const void *from, const char *plugin_path,
                           msim_comm **comm, msim_error *err) {
  if (!name || !comm) return ms_error_set(err, MSIM_ERR_ARG, "name or comm is NULL");
  const msim_allocator alloc = ms_memory_allocator(NULL);
  plugin_comm *p = ms_memory_allocate(&alloc, 1, sizeof *p);
  *comm = NULL;
  if (!p) return ms_error_set_memory(err, "the communicator");
  p->alloc = alloc;
  ms_plugin_init_host(&p->host, &p->alloc);
  const msim_status status = open_comm(p, name, from, plugin_path, err);
  if (status) {
    ms_memory_free(&alloc, p);
    return status;
  }
  *comm = &p->comm;
  return ms_error_clear(err);
}

void msim_comm_close(msim_comm *comm) {
  if (!comm) return;
  plugin_comm *p = (plugin_comm *)comm;
  const msim_allocator alloc = p->alloc;
  p->type->close(p->own);
  ms_memory_free(&alloc, p);
}
