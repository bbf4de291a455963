/* fake_plugins - plugins of recorder and importer for fuzz targets, whose tables the target defines
 * */
#include "msim/importer.h"
#include "msim/recorder.h"

const msim_recorder_type *fuzz_recorder(void);
const msim_importer *fuzz_importer(void);

MSIM_RECORDER_ENTRY(hdf5) { return fuzz_recorder(); }
MSIM_IMPORTER_ENTRY(hdf5) { return fuzz_importer(); }
