#include <sweep/formula.h>

#include <base/error.h>
#include <base/nearest.h>
#include <base/split.h>

#include <muParser.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <ranges>
#include <string>
#include <vector>

namespace palpate::sweep {

namespace {

std::vector<std::string> variablesIn(const std::map<std::string, double>& values)
{
    std::vector<std::string> names;
    std::ranges::copy(values | std::views::keys, std::back_inserter(names));
    return names;
}

}  // namespace

double evaluate(const std::string& formula, const std::map<std::string, double>& values)
{
    try {
        mu::Parser parser, names;  // the second says which of them it uses; a formula may assign to its variables
        std::map<std::string, double> variables = values;
        for (auto& [name, value] : variables) {
            parser.DefineConst(name, value);
            names.DefineVar(name, &value);
        }
        parser.SetExpr(formula);
        names.SetExpr(formula);
        const double value = parser.Eval();
        // Several values between commas give the last one: 0,5 would be 5.
        base::failIf(parser.GetNumResults() > 1, "formula '{}': has several values: write a decimal point", formula);
        // A comparison with what is missing would be 0, a number like any other.
        const auto isMissing = [](const auto& used) { return std::isnan(*used.second); };
        return std::ranges::any_of(names.GetUsedVar(), isMissing) ? std::numeric_limits<double>::quiet_NaN() : value;
    } catch (const mu::Parser::exception_type& e) {
        const std::string token(base::trimmed(e.GetToken()));
        base::failIf(e.GetCode() == mu::ecUNASSIGNABLE_TOKEN && isVariable(token), "formula '{}': there is no {}{}",
                     formula, token, base::meant(token, variablesIn(values)));
        throw base::error("formula '{}': {}", formula, e.GetMsg());
    }
}

bool isVariable(const std::string& name)
{
    return !name.empty() &&
           name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_") == std::string::npos &&
           (name[0] < '0' || name[0] > '9');
}

}  // namespace palpate::sweep
