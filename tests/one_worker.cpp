// TBB is not built with the thread sanitizer, which therefore cannot see that its workers wait for each other: under that
// sanitizer TBB gets one worker, and what remains are our own threads.
#include <tbb/global_control.h>

namespace {

const tbb::global_control oneWorker(tbb::global_control::max_allowed_parallelism, 1);

}  // namespace
