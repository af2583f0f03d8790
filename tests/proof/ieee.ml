(* SPDX-License-Identifier: MIT *)
(* Two facts of IEEE 754 that Frama-C 25 does not use, told to it. The program stays as it is.

   1. a < b (or >, <=, >=) holds only if neither side is a NaN. `if (a < b) S` becomes `if (a < b) { admit a and b are numbers; S }`,
      and `x = a < b` becomes `if (a < b) x = 1; else x = 0;`, for whole numbers, too: the two cases can then be followed apart.
   2. x - x is 0 for a finite x and a NaN for any other. The core asks so whether numbers are finite. An interval for x says nothing about
      x - x, so it becomes `if (-FLT_MAX <= x && x <= FLT_MAX) t = 0; else t = NaN;`. *)
open Cil_types

let emitter = Emitter.create "ieee" [ Emitter.Code_annot ] ~correctness:[] ~tuning:[]
let number loc kind value = Cil.new_exp ~loc (Const (CReal (value, kind, None)))
let largest = function FFloat -> 0x1.fffffep127 | _ -> max_float

let rec comparison e =
  match e.enode with
  | CastE (_, inner) -> comparison inner
  | UnOp (LNot, inner, _) -> Option.map (fun (holds, a, b) -> (not holds, a, b)) (comparison inner)
  | BinOp ((Lt | Gt | Le | Ge), a, b, _) when Cil.isFloatingType (Cil.typeOf a) -> Some (true, a, b)
  | _ -> None

let rec uncast e = match e.enode with CastE (_, inner) -> uncast inner | _ -> e

let is_comparison e =
  match (uncast e).enode with
  | UnOp (LNot, _, _) | BinOp ((Lt | Gt | Le | Ge | Eq | Ne), _, _, _) -> true
  | _ -> false

let width t = match Cil.unrollType t with TFloat (kind, _) -> Some kind | _ -> None

let is_a_number e =
  let takes_our_type f =
    match f.l_profile with [ { lv_type = Ctype t; _ } ] -> width t = width (Cil.typeOf e) | _ -> false
  in
  let is_nan = List.find takes_our_type (Logic_env.find_all_logic_functions "\\is_NaN") in
  Logic_const.pnot (Logic_const.papp (is_nan, [], [ Logic_utils.expr_to_term e ]))

(* Fact 1. *)
class ordered =
  object (self)
    inherit Visitor.frama_c_inplace

    method private admit loc (holds, a, b) yes no =
      let kf = Option.get self#current_kf in
      let here = Cil.mkStmt ~valid_sid:true (Instr (Skip loc)) in
      let sides = List.filter (fun e -> not (Cil.isConstant (Cil.stripCasts e))) [ a; b ] in
      let claim = Logic_const.pands (List.map is_a_number sides) in
      let annotation = AAssert ([], Logic_const.toplevel_predicate ~kind:Admit claim) in
      let block = if holds then yes else no in
      block.bstmts <- here :: block.bstmts;
      File.must_recompute_cfg (Kernel_function.get_definition kf);
      Queue.add
        (fun () -> Annotations.add_code_annot emitter ~kf here (Logic_const.new_code_annotation annotation))
        self#get_filling_actions

    method! vstmt_aux _ =
      let finish stmt =
        (match stmt.skind with
        | If (condition, yes, no, loc) ->
            Option.iter (fun found -> self#admit loc found yes no) (comparison condition)
        | Instr (Set (place, value, loc)) when is_comparison value ->
            let set number =
              let value = Cil.mkCast ~newt:(Cil.typeOfLval place) number in
              Cil.mkBlock [ Cil.mkStmt ~valid_sid:true (Instr (Set (place, value, loc))) ]
            in
            let yes = set (Cil.one ~loc) and no = set (Cil.zero ~loc) in
            File.must_recompute_cfg (Option.get self#current_func);
            stmt.skind <- If (uncast value, yes, no, loc);
            Option.iter (fun found -> self#admit loc found yes no) (comparison value)
        | _ -> ());
        stmt
      in
      Cil.DoChildrenPost finish
  end

(* Fact 2. *)
class differences =
  object (self)
    inherit Visitor.frama_c_inplace
    val mutable before = []

    method! vexpr e =
      match e.enode with
      | BinOp (MinusA, a, b, t) when Cil.isFloatingType t && Cil_datatype.ExpStructEq.equal a b ->
          let loc = e.eloc and f = Option.get self#current_func in
          let kind = Option.get (width t) in
          let result = Cil.var (Cil.makeTempVar f ~name:"x_minus_x" t) in
          let set value = Cil.mkBlock [ Cil.mkStmt ~valid_sid:true (Instr (Set (result, value, loc))) ] in
          let zero = number loc kind 0. in
          let nan () = set (Cil.new_exp ~loc (BinOp (Div, zero, zero, t))) in
          let compare op x y = Cil.new_exp ~loc (BinOp (op, x, y, Cil.intType)) in
          let test condition yes = Cil.mkStmt ~valid_sid:true (If (condition, yes, nan (), loc)) in
          let top = number loc kind (largest kind) and bottom = number loc kind (-.largest kind) in
          let inner = test (compare Ge a bottom) (set zero) in
          before <- test (compare Le a top) (Cil.mkBlock [ inner ]) :: before;
          Cil.ChangeTo (Cil.new_exp ~loc (Lval result))
      | _ -> Cil.DoChildren

    method! vstmt_aux stmt =
      match stmt.skind with
      | Instr (Set (place, value, loc)) ->
          before <- [];
          let value = Visitor.visitFramacExpr (self :> Visitor.frama_c_visitor) value in
          if before <> [] then begin
            let last = Cil.mkStmt ~valid_sid:true (Instr (Set (place, value, loc))) in
            stmt.skind <- Block (Cil.mkBlock (List.rev (last :: before)));
            File.must_recompute_cfg (Option.get self#current_func)
          end;
          Cil.SkipChildren
      | _ -> Cil.DoChildren
  end

let () =
  let category = File.register_code_transformation_category "ieee" in
  File.add_code_transformation_after_cleanup category (fun file ->
      Visitor.visitFramacFileSameGlobals (new differences) file;
      Visitor.visitFramacFileSameGlobals (new ordered) file)
