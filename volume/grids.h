#pragma once

#include <openvdb/openvdb.h>

// Inside volume/ only. The code of these trees is in OpenVDB's library, which does not say so in its headers: without this,
// every source that makes a grid compiles it again, which takes up to two thirds of the source's time. The library lacks
// the short functions that were inlined where it was built: without optimisation, and with -Os, ours would not link.
#if OPENVDB_LIBRARY_MAJOR_VERSION_NUMBER == 10 && defined(__OPTIMIZE__) && !defined(__OPTIMIZE_SIZE__)

namespace openvdb::OPENVDB_VERSION_NAME {

extern template class tree::Tree<FloatTree::RootNodeType>;
extern template class tree::Tree<Int32Tree::RootNodeType>;
extern template class tree::Tree<BoolTree::RootNodeType>;
extern template class tree::Tree<DoubleTree::RootNodeType>;
extern template class tree::Tree<Int64Tree::RootNodeType>;

}  // namespace openvdb::OPENVDB_VERSION_NAME

#endif
