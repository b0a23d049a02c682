#include <reference/factor.h>

#include <base/error.h>

#include <dlfcn.h>
#include <dmumps_c.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

extern "C" {

void dgemv_(const char* turn, const int* rows, const int* columns, const double* alpha, const double* a, const int* leadA,
            const double* x, const int* stepX, const double* beta, double* y, const int* stepY);

// Debian's MUMPS multiplies by dgemm even where there is one right-hand side, and Debian's OpenBLAS copies the whole matrix
// for that: two thirds of the time of a solution. This program's own dgemm takes such calls to dgemv, and hands on the
// rest.
void dgemm_(const char* turnA, const char* turnB, const int* m, const int* n, const int* k, const double* alpha,
            const double* a, const int* leadA, const double* b, const int* leadB, const double* beta, double* c,
            const int* leadC)
{
    using Dgemm = decltype(&dgemm_);
    static const auto blas = reinterpret_cast<Dgemm>(dlsym(RTLD_NEXT, "dgemm_"));
    const bool plainA = *turnA == 'N' || *turnA == 'n';
    const bool plainB = *turnB == 'N' || *turnB == 'n';
    constexpr int one = 1;
    if (*n == 1 && *m > 0 && *k > 0) {
        dgemv_(turnA, plainA ? m : k, plainA ? k : m, alpha, a, leadA, b, plainB ? &one : leadB, beta, c, &one);
    } else {
        blas(turnA, turnB, m, n, k, alpha, a, leadA, b, leadB, beta, c, leadC);
    }
}

}  // extern "C"

namespace palpate::reference {

namespace {

// MUMPS's switches by the numbers of its manual.
constexpr int worldOfOne = -987654;
enum Job { begin = -1, end = -2, substitute = 3, analyseAndFactorize = 4 };

double dot(std::span<const double> a, std::span<const double> b)
{
    return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

void addScaled(double s, std::span<const double> x, std::span<double> y)
{
    for (std::size_t i = 0; i < y.size(); ++i) {
        y[i] += s * x[i];
    }
}

// The least-squares problem of GMRES, kept triangular by rotations.
struct Hessenberg {
    std::vector<std::vector<double>> columns;
    std::vector<std::array<double, 2>> turns;
    std::vector<double> right;

    // Takes column `h`, one longer than the ones before it plus one; gives the residual.
    double add(std::vector<double> h)
    {
        const std::size_t k = columns.size();
        for (std::size_t i = 0; i < k; ++i) {
            const auto [c, s] = turns[i];
            const double low = h[i];
            h[i] = c * low + s * h[i + 1];
            h[i + 1] = -s * low + c * h[i + 1];
        }
        const double length = std::hypot(h[k], h[k + 1]);
        const double c = length > 0.0 ? h[k] / length : 1.0;
        const double s = length > 0.0 ? h[k + 1] / length : 0.0;
        h[k] = length;
        h.pop_back();
        turns.push_back({c, s});
        right.push_back(-s * right[k]);
        right[k] *= c;
        columns.push_back(std::move(h));
        return std::abs(right.back());
    }

    std::vector<double> solution() const
    {
        std::vector<double> y(columns.size());
        for (std::size_t i = y.size(); i-- > 0;) {
            double sum = right[i];
            for (std::size_t j = i + 1; j < y.size(); ++j) {
                sum -= columns[j][i] * y[j];
            }
            y[i] = columns[i][i] != 0.0 ? sum / columns[i][i] : 0.0;
        }
        return y;
    }
};

}  // namespace

void SymmetricMatrix::multiply(std::span<const double> x, std::span<double> y) const noexcept
{
    for (std::size_t c = 0; c < size(); ++c) {
        double sum = 0.0;
        for (std::size_t k = start[c]; k < start[c + 1]; ++k) {
            sum += value[k] * x[static_cast<std::size_t>(row[k])];
        }
        y[c] = sum;
    }
}

struct Factor::Impl {
    DMUMPS_STRUC_C mumps{};

    void run(Job job)
    {
        mumps.job = job;
        dmumps_c(&mumps);
    }
};

Factor::Factor(const SymmetricMatrix& matrix) : impl_(std::make_unique<Impl>())
{
    std::vector<MUMPS_INT> row;
    std::vector<MUMPS_INT> column;
    std::vector<double> value;
    std::vector<MUMPS_INT> blocks(matrix.blocks.size());
    std::transform(matrix.blocks.begin(), matrix.blocks.end(), blocks.begin(), [](int first) { return first + 1; });
    for (std::size_t c = 0; c < matrix.size(); ++c) {
        for (std::size_t k = matrix.start[c]; k < matrix.start[c + 1]; ++k) {
            if (static_cast<std::size_t>(matrix.row[k]) >= c) {
                row.push_back(matrix.row[k] + 1);
                column.push_back(static_cast<MUMPS_INT>(c) + 1);
                value.push_back(matrix.value[k]);
            }
        }
    }
    DMUMPS_STRUC_C& m = impl_->mumps;
    m.par = 1;
    m.sym = 2;
    m.comm_fortran = worldOfOne;
    impl_->run(begin);
    std::fill_n(m.icntl, 4, 0);  // says nothing
    m.icntl[6] = 3;              // orders by SCOTCH
    m.icntl[14] = 1;             // node by node
    m.icntl[13] = 40;            // this many percent of memory over the estimate
    m.n = static_cast<MUMPS_INT>(matrix.size());
    m.nnz = static_cast<MUMPS_INT8>(value.size());
    m.irn = row.data();
    m.jcn = column.data();
    m.a = value.data();
    m.nblk = static_cast<MUMPS_INT>(blocks.size()) - 1;
    m.blkptr = blocks.data();
    impl_->run(analyseAndFactorize);
    const int status = m.infog[0];
    if (status < 0) {
        impl_->run(end);
        throw base::error("a system of {} unknowns cannot be factorized (MUMPS says {}): {}", m.n, status,
                          status == -10 ? "it is singular, hold the body somewhere"
                                        : "there may not be memory enough, make the elements larger");
    }
    m.irn = m.jcn = m.blkptr = nullptr;
    m.a = nullptr;
}

Factor::~Factor()
{
    impl_->run(end);
}

void Factor::solve(std::span<double> x) const
{
    impl_->mumps.nrhs = 1;
    impl_->mumps.rhs = x.data();
    impl_->run(substitute);
}

bool solveNearby(const SymmetricMatrix& a, const Factor& nearby, std::span<const double> b, std::span<double> x,
                 double fraction, int most)
{
    std::fill(x.begin(), x.end(), 0.0);
    const double whole = std::sqrt(dot(b, b));
    if (whole == 0.0) {
        return true;
    }
    std::vector<std::vector<double>> basis{std::vector<double>(b.begin(), b.end())};
    std::vector<std::vector<double>> images;  // of the basis under the factor
    for (double& v : basis[0]) {
        v /= whole;
    }
    Hessenberg h{.columns = {}, .turns = {}, .right = {whole}};
    double left = whole;
    for (int step = 0; step < most && left > fraction * whole; ++step) {
        images.push_back(basis.back());
        nearby.solve(images.back());
        std::vector<double> next(b.size());
        a.multiply(images.back(), next);
        std::vector<double> column;
        for (const std::vector<double>& q : basis) {
            column.push_back(dot(q, next));
            addScaled(-column.back(), q, next);
        }
        column.push_back(std::sqrt(dot(next, next)));
        for (double& v : next) {
            v /= std::max(column.back(), 1e-300);
        }
        basis.push_back(std::move(next));
        left = h.add(std::move(column));
    }
    const std::vector<double> y = h.solution();
    for (std::size_t k = 0; k < y.size(); ++k) {
        addScaled(y[k], images[k], x);
    }
    return left <= fraction * whole;
}

}  // namespace palpate::reference
