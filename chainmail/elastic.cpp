#include <chainmail/elastic.h>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::chainmail {

namespace {

constexpr std::size_t mostTools = 16;
constexpr int newtonSteps = 3;      // of a line search: contacts open and close along it
constexpr int mostHalvings = 8;     // of a step that raises the energy
constexpr int refreshPeriod = 256;  // calls after which forces that are carried along are computed anew
constexpr double rounding = 1e-6;   // relative: sums of single-precision products are no better

std::size_t cornerNode(const Layout& l, std::size_t node, int c) noexcept
{
    return node + static_cast<std::size_t>(c & 1) + (static_cast<std::size_t>(c >> 1) & 1) * l.row +
           (static_cast<std::size_t>(c >> 2) & 1) * l.plane;
}

}  // namespace

Elastic::Elastic(const ElasticBody& body, const ElasticOptions& options, const Focus& focus)
    : options_(options),
      stack_(body, options.window, focus),
      multigrid_(stack_, 8 * options.maxSites),
      sites_(options.maxSites)
{
    shapes_.reserve(mostTools);
}

std::size_t Elastic::nodes() const noexcept
{
    std::size_t sum = 0;
    for (const Window& w : stack_.windows()) {
        const Index3 n = w.size();
        sum += static_cast<std::size_t>(n.x) * static_cast<std::size_t>(n.y) * static_cast<std::size_t>(n.z);
    }
    return sum;
}

Vec3 Elastic::displacement(Vec3 rest) const noexcept
{
    ContactSite site;
    locate(stack_.body(), stack_.windows(), rest, site);
    return site.level < stack_.size() ? gather(stack_.windows(), site, Field::u) : Vec3(0.0);
}

void Elastic::settle() noexcept
{
    siteCount_ = 0;
    if (atRest_) {
        return;
    }
    for (const Field f : {Field::u, Field::a, Field::d, Field::e, Field::r}) {
        stack_.clear(f);
    }
    energy_ = 0.0;
    atRest_ = true;
    hasIncrement_ = false;
}

void Elastic::meet(const ElasticLoad& load) noexcept
{
    shapes_.clear();
    for (const ElasticTool& tool : load.tools.first(std::min(load.tools.size(), mostTools))) {
        shapes_.emplace_back(tool.shape);
    }
    ties_ = load.ties;
    siteCount_ = findSites(stack_.body(), stack_.windows(), load, shapes_, sites_);
    for (ContactSite& s : active()) {
        touch(s, shapes_, ties_);
    }
}

// True when a tool is inside the tissue, as it lies or as it would lie at rest.
bool Elastic::touched() const noexcept
{
    const auto all = sites();
    return std::any_of(all.begin(), all.end(),
                       [&](const ContactSite& s) { return s.active() || shapes_[s.owner].distance(s.rest) < 0.0; });
}

// The tissue's forces anew, where they cannot be carried along.
void Elastic::refreshForces() noexcept
{
    if (options_.finiteStrain) {
        energy_ = stack_.applyFinite(Field::u, Field::a);
    } else {
        stack_.apply(Field::u, Field::a);
        energy_ = -0.5 * stack_.dot(Field::u, Field::a);
    }
    if (hasIncrement_) {
        stack_.apply(Field::d, Field::e);
    }
}

// r = forces of the tissue and of the contacts.
void Elastic::refreshResidual() noexcept
{
    const Kernels& k = stack_.kernels();
    for (Window& w : stack_.windows()) {
        k.smoothFirst(1.0F, w.dof.data(), w.field(Field::a), w.field(Field::r), w.layout.count);
    }
    for (const ContactSite& s : sites()) {
        if (!s.active()) {
            continue;
        }
        const Layout& l = stack_[s.level].layout;
        for (int c = 0; c < 8; ++c) {
            stack_.addForce(s.level, cornerNode(l, s.node, c),
                            static_cast<double>(s.share[static_cast<std::size_t>(c)]) * s.force);
        }
    }
}

void Elastic::prepareContacts() noexcept
{
    multigrid_.clearContacts();
    for (const ContactSite& s : sites()) {
        if (!s.active()) {
            continue;
        }
        const glm::dmat3 tangent =
            s.across * glm::dmat3(1.0) + (s.stiffness - s.across) * glm::outerProduct(s.normal, s.normal);
        const Layout& l = stack_[s.level].layout;
        for (int c = 0; c < 8; ++c) {
            const double share = static_cast<double>(s.share[static_cast<std::size_t>(c)]);
            multigrid_.addContact(s.level, cornerNode(l, s.node, c), share * tangent);
        }
    }
    multigrid_.prepare();
}

void Elastic::look(Field direction) noexcept
{
    for (ContactSite& s : active()) {
        s.p = gather(stack_.windows(), s, direction);
    }
}

// How far to go: Newton on the slope of the energy, the tissue's part a parabola, contacts opening and closing on the way.
double Elastic::lineSearch(double slope, double curvature) const noexcept
{
    double alpha = 0.0;
    for (int i = 0; i < newtonSteps; ++i) {
        const Along at = contactsAlong(sites(), alpha);
        const double stiffness = curvature + at.curvature;
        const double change = -(slope + alpha * curvature + at.slope) / stiffness;
        if (!(stiffness > 0.0) || !std::isfinite(change)) {
            return 0.0;
        }
        alpha += change;
    }
    return alpha;
}

double Elastic::contactEnergy() const noexcept
{
    double sum = 0.0;
    for (const ContactSite& s : sites()) {
        sum += s.energy;
    }
    return sum;
}

void Elastic::go(double alpha, Field direction) noexcept
{
    stack_.add(alpha, direction, Field::u);
    for (ContactSite& s : active()) {
        s.u += alpha * s.p;
        touch(s, shapes_, ties_);
    }
}

// Goes along the direction that look() saw, whose image under -A is known, as far as lowers the energy. A step after which
// the energy is higher (the contacts' line search is of first order, and finite strain has no parabola) is halved, and
// taken back at last. False: nowhere.
bool Elastic::takeStep(Field direction, Field image, ElasticResult& result) noexcept
{
    const double slope = -stack_.dot(Field::a, direction);
    const double curvature = -stack_.dot(image, direction);
    const double tissue = energy_;
    const double before = tissue + contactEnergy();
    double alpha = lineSearch(slope, curvature);
    double gone = 0.0;
    for (int i = 0; alpha != gone; ++i) {
        go(alpha - gone, direction);
        gone = alpha;
        energy_ = options_.finiteStrain ? stack_.applyFinite(Field::u, Field::a)
                                        : tissue + (slope + 0.5 * curvature * alpha) * alpha;
        const double scale = std::abs(before) + std::abs(slope * alpha);
        if (energy_ + contactEnergy() <= before + rounding * scale) {
            break;
        }
        alpha = i < mostHalvings ? 0.5 * alpha : 0.0;
        ++result.shortened;
    }
    if (!options_.finiteStrain) {
        stack_.add(alpha, image, Field::a);
    }
    // The increment of this call so far: what was kept of the last one's, and the steps since.
    const double kept = direction == Field::d ? alpha - 1.0 : alpha;
    stack_.add(kept, direction, Field::d);
    stack_.add(kept, image, Field::e);
    return alpha != 0.0;
}

// One step of preconditioned conjugate gradients, conjugate to `before`.
bool Elastic::oneCycle(Before before, ElasticResult& result) noexcept
{
    prepareContacts();
    multigrid_.solve();
    stack_.apply(Field::z, Field::f);
    if (before == Before::increment) {
        stack_.copy(Field::d, Field::p);
        stack_.copy(Field::e, Field::q);
    }
    double beta = 0.0;
    if (before != Before::none) {
        double own = -stack_.dot(Field::p, Field::q);
        double mixed = -stack_.dot(Field::z, Field::q);
        for (const ContactSite& s : sites()) {
            const Vec3 resisted = s.resist(s.p);
            own += glm::dot(s.p, resisted);
            mixed += glm::dot(gather(stack_.windows(), s, Field::z), resisted);
        }
        beta = own > 0.0 && std::isfinite(mixed / own) ? -mixed / own : 0.0;
    }
    stack_.scaleAdd(Field::z, beta, Field::p);
    stack_.scaleAdd(Field::f, beta, Field::q);
    look(Field::p);
    return takeStep(Field::p, Field::q, result);
}

ElasticResult Elastic::relax(const ElasticLoad& load, int cycles, double tolerance) noexcept
{
    ElasticResult result;
    multigrid_.clearContacts();
    result.moved = stack_.follow(load.focus, !atRest_);
    meet(load);
    if (!touched()) {
        settle();
        return result;
    }
    atRest_ = false;
    if (result.moved || ++sinceRefresh_ >= refreshPeriod) {
        refreshForces();
        sinceRefresh_ = 0;
    }
    Before before = Before::none;
    look(Field::d);
    if (hasIncrement_ && takeStep(Field::d, Field::e, result)) {
        before = Before::increment;
    } else {
        stack_.clear(Field::d);
        stack_.clear(Field::e);
    }
    hasIncrement_ = true;
    for (int i = 0; i < cycles; ++i) {
        refreshResidual();
        if (tolerance > 0.0) {
            result.residual = std::sqrt(stack_.dot(Field::r, Field::r));
            if (result.residual <= tolerance * contactForce()) {
                break;
            }
        }
        ++result.cycles;
        before = oneCycle(before, result) ? Before::direction : Before::none;
    }
    measure(result);
    return result;
}

void Elastic::measure(ElasticResult& result) const noexcept
{
    result.energy = energy_ + contactEnergy();
    for (const ContactSite& s : sites()) {
        if (!s.isTie && s.active()) {
            ++result.contacts;
            result.depth = std::max(result.depth, s.depth);
        }
    }
}

// Sum of the contacts' forces, each by its size [N].
double Elastic::contactForce() const noexcept
{
    double sum = 0.0;
    for (const ContactSite& s : sites()) {
        sum += glm::length(s.force);
    }
    return sum;
}

Vec3 Elastic::force(std::size_t owner, bool isTie) const noexcept
{
    Vec3 sum(0.0);
    for (const ContactSite& s : sites()) {
        if (s.owner == owner && s.isTie == isTie) {
            sum -= s.force;
        }
    }
    return sum;
}

}  // namespace palpate::chainmail
